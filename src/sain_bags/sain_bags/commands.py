"""The executables of this package, with the modules of it that they load."""

from typing import Final

from sain_core.cli.command_line import Command

record: Final = Command(
    "sain_bags record", "cli.options:RecordOptions", "ros.record:run", ros=True, prefixes=True
)
play: Final = Command("sain_bags play", "cli.options:PlayOptions", "ros.play:run", ros=True)
view: Final = Command("sain_bags view", "cli.options:ViewOptions", "ros.view:run")
info: Final = Command("sain_bags info", "cli.options:InfoOptions", "cli.info:run")
recover: Final = Command("sain_bags recover", "cli.options:RecoverOptions", "cli.recover:run")
report: Final = Command("sain_bags report", "cli.options:ReportOptions", "cli.report:run")
to_dataset: Final = Command(
    "sain_bags to_dataset", "cli.options:ToDatasetOptions", "cli.to_dataset:run", resumes="shard"
)
