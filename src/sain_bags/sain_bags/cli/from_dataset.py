"""``ros2 run sain_bags from_dataset``: a data set becomes a recording."""

from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console

from sain_bags.dataset.recorded import write_recording
from sain_core.cli.terminal import WaitingLine
from sain_core.config import Config, required


@dataclass(frozen=True)
class FromDatasetOptions(Config):
    """Write the pushes of a data set as a bag, such as those of a real robot that were imported.

    The report, `view`, `play`, `to_dataset` and the tools of ROS 2 read it.
    """

    data: tyro.conf.Positional[Path] = required("folder of a data set with npz shards")
    out: Path = required("folder of the new bag")


def run(options: FromDatasetOptions, console: Console) -> None:
    """Write the bag and print where it is."""
    with WaitingLine(Console(stderr=True)) as line:
        count = write_recording(
            options.data,
            options.out,
            lambda done, of: line.say(f"{done:,} of {of:,} pushes"),
        )
    console.print(f"{count:,} pushes: {options.out}", soft_wrap=True, highlight=False)
