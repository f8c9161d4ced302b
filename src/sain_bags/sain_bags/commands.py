"""The executables of this package."""

from typing import Final

from sain_core.cli.command_line import Command

record: Final = Command(
    "sain_bags record",
    options="sain_bags.cli.options:RecordOptions",
    work="sain_bags.ros.record:run",
    ros=True,
    prefixes=True,
)
play: Final = Command(
    "sain_bags play",
    options="sain_bags.cli.options:PlayOptions",
    work="sain_bags.ros.play:run",
    ros=True,
)
info: Final = Command(
    "sain_bags info", options="sain_bags.cli.options:InfoOptions", work="sain_bags.cli.info:run"
)
recover: Final = Command(
    "sain_bags recover",
    options="sain_bags.cli.options:RecoverOptions",
    work="sain_bags.cli.recover:run",
)
report: Final = Command(
    "sain_bags report",
    options="sain_bags.cli.options:ReportOptions",
    work="sain_bags.cli.report:run",
)
to_dataset: Final = Command(
    "sain_bags to_dataset",
    options="sain_bags.cli.options:ToDatasetOptions",
    work="sain_bags.cli.to_dataset:run",
    resumes="shard",
)
