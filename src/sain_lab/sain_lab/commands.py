"""The executables of this package, with the modules of it that they load."""

from typing import Final

from sain_core.cli.command_line import Command

lab: Final = Command("sain_lab lab", "cli.lab", resumes="push")
