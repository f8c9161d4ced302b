"""The executables of this package."""

from typing import Final

from sain_core.cli.command_line import Command

evaluate: Final = Command(
    "sain_eval evaluate",
    options="sain_eval.cli.options:EvaluateOptions",
    work="sain_eval.cli.evaluate:run",
    resumes="episode",
    prefixes=True,
)
calibrate: Final = Command(
    "sain_eval calibrate",
    options="sain_eval.cli.options:CalibrateOptions",
    work="sain_eval.cli.calibrate:run",
)
