"""The executables of this package, with the modules of it that they load."""

from typing import Final

from sain_core.cli.command_line import Command

evaluate: Final = Command("sain_eval evaluate", "cli.evaluate", resumes="episode", prefixes=True)
results: Final = Command("sain_eval results", "cli.results")
verify: Final = Command("sain_eval verify", "cli.verify", resumes="episode")
