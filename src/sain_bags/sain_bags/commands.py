"""The executables of this package, with the modules of it that they load."""

from typing import Final

from sain_core.cli.command_line import Command

record: Final = Command("sain_bags record", "ros.record", ros=True, prefixes=True)
play: Final = Command("sain_bags play", "ros.play", ros=True)
view: Final = Command("sain_bags view", "ros.view")
info: Final = Command("sain_bags info", "cli.info")
recover: Final = Command("sain_bags recover", "cli.recover")
report: Final = Command("sain_bags report", "cli.report")
to_dataset: Final = Command("sain_bags to_dataset", "cli.to_dataset", resumes="shard")
from_dataset: Final = Command("sain_bags from_dataset", "cli.from_dataset")
