"""The executables of this package, with the modules of it that they load."""

from typing import Final

from sain_core.cli.command_line import Command

evaluate: Final = Command(
    "sain_pusht evaluate", "evaluation", resumes="episode", prefixes=True, alias="evaluate_pusht"
)
learn: Final = Command("sain_pusht learn", "learning", alias="learn_pusht")
