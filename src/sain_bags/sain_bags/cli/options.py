"""Options of this package's commands; they load without rclpy."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from sain_bags.dataset.conversion import ConversionConfig
from sain_bags.playing import PassageConfig
from sain_bags.report.gathering import Limits
from sain_bags.writing.writer import BagConfig
from sain_core.config import Config, option, required
from sain_core.workers.running import WorkerOptions

BAG = "a bag's folder, or its MCAP file"


@dataclass(frozen=True)
class RecordOptions(Config):
    """Record a running graph to a bag (rosbag2 layout, MCAP).

    All topics are recorded, also those that appear later, with the definitions of their messages;
    service calls where introspection is on. Ctrl-C ends the recording and makes the bag whole.
    """

    out: Path = required("folder to make for the bag; must not exist")
    resume: bool = option(
        False, "go on with a recording that a crash has cut off; both become one bag at the end"
    )
    topics: tuple[str, ...] = option(
        (), "topics to record, with their full names; none: all that are not hidden"
    )
    include_hidden: bool = option(False, "record hidden topics, too")
    custom_data: Annotated[tuple[str, ...], tyro.conf.arg(metavar="KEY=VALUE ...")] = option(
        (), "what the bag should say about itself"
    )
    status_period: float = option(
        10.0,
        "time between lines about the state, where no terminal shows it; 0: no lines",
        unit="s",
        minimum=0.0,
    )
    bag: BagConfig = field(default_factory=BagConfig)


@dataclass(frozen=True)
class PlayOptions(Config):
    """Play a bag: publish its messages again as they were recorded, at the recorded times.

    Ctrl-C ends it. Topics are renamed with --ros-args -r /from:=/to.
    """

    bag: tyro.conf.Positional[Path] = required(BAG)
    topics: tuple[str, ...] = option(
        (), "topics to play, with their full names; none: all but /parameter_events"
    )
    namespace: str = option("", "prefix of every topic's name except /clock")
    wait: float = option(
        1.0, "longest wait until every topic has a subscriber", unit="s", minimum=0.0
    )
    passage: PassageConfig = field(default_factory=PassageConfig)


@dataclass(frozen=True)
class ViewOptions(Config):
    """Play a bag in the live page, with a timeline, until Ctrl-C; the page's address is printed.

    Nothing is published, so a graph may run beside it.
    """

    bag: tyro.conf.Positional[Path] = required(BAG)
    rate: float = option(1.0, "simulated time / playing time", minimum=1e-3, maximum=1e3)
    host: str = option("127.0.0.1", "address to listen at; 0.0.0.0: open to other computers")
    port: int = option(8080, "port to listen at", minimum=1, maximum=65535)
    loop: bool = option(True, "begin again at the end")


@dataclass(frozen=True)
class InfoOptions(Config):
    """Show the contents of a bag: topics, rates, gaps, episodes and pushes."""

    bag: tyro.conf.Positional[Path] = required(BAG)
    check: bool = option(
        True, "read all messages and compare every CRC; without it no gaps are shown"
    )


@dataclass(frozen=True)
class RecoverOptions(Config):
    """Save what is undamaged in a truncated or damaged bag to a new, whole one.

    Exit code: 0 all was saved, 3 something was lost (it says what), 1 nothing could be saved.
    """

    bag: tyro.conf.Positional[Path] = required(
        "a bag's folder, also without metadata.yaml, or an MCAP file"
    )
    out: Path = required("folder to make for the new bag; must not exist")


@dataclass(frozen=True)
class ReportOptions(Config):
    """Write a page that shows a bag: episodes from above, predictions, planning times, gaps.

    The page is one HTML file. It loads nothing, and opens in any browser.
    """

    bag: tyro.conf.Positional[Path] = required(BAG)
    out: Path | None = option(
        None,
        "the file to write; by default report.html beside the bag's folder, or the MCAP file's name"
        " with .html",
    )
    overwrite: bool = option(False, "replace a file that exists")
    frames: int = option(
        Limits.frames,
        "most scenes in motion of an episode; of more, every second, fourth, ... is shown",
        minimum=1,
    )
    episodes: int = option(
        Limits.episodes, "most episodes shown one by one; the figures are of all", minimum=1
    )


@dataclass(frozen=True)
class ToDatasetOptions(WorkerOptions):
    """Convert recordings to transitions to train on; the same command continues after a stop."""

    bags: tyro.conf.Positional[tuple[Path, ...]] = required(
        "bags, MCAP files, or folders with bags below them"
    )
    out: Path = required("a new or empty folder, or that of a conversion")
    overwrite: bool = option(False, "replace what a conversion made there")
    conversion: ConversionConfig = field(default_factory=ConversionConfig)
