"""``ros2 run sain_bags record``: records topics to a bag, those that appear late too."""

import signal
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Annotated, Final

import rclpy
import tyro
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from rich.console import Console

from sain_bags.ros.recorder import Recorder
from sain_bags.writing.gaps import MISSING_KEY, describe_gaps
from sain_bags.writing.recording_status import RecordingStatus, StatusDisplay
from sain_bags.writing.selection import Selection
from sain_bags.writing.writer import BagConfig, BagWriter
from sain_core.errors import ConfigError, SainError

PASS_PERIOD: Final = 0.01  # [s] between passes over all topics, also how soon a signal is noticed
DRAIN_TIME: Final = 0.5  # [s], at most, for messages that have come before the stop
QUIET_PASSES: Final = 5  # without a message: nothing more is on its way


@dataclass(frozen=True)
class RecordOptions:
    """Record a running graph to a bag (rosbag2 layout, MCAP).

    All topics are recorded, also those that appear later, with the definitions of their messages;
    service calls where introspection is on. Ctrl-C ends the recording and makes the bag whole.
    """

    out: Path
    """Folder to make for the bag; must not exist."""
    topics: tuple[str, ...] = ()
    """Topics to record, with their full names; none: all that are not hidden."""
    include_hidden: bool = False
    """Record hidden topics, too."""
    custom_data: Annotated[tuple[str, ...], tyro.conf.arg(metavar="KEY=VALUE ...")] = ()
    """What the bag should say about itself."""
    status_period: float = 10.0
    """Seconds between lines about the state, where no terminal shows it all the time; 0: none."""
    bag: BagConfig = field(default_factory=BagConfig)


def parse_custom_data(pairs: tuple[str, ...]) -> dict[str, str]:
    """Return ``KEY=VALUE`` words as a dictionary.

    Raises:
        ConfigError: a word without a key or without ``=``.
    """
    data = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not key or not equals:
            raise ConfigError(f"custom data is {pair!r}; it must be KEY=VALUE")
        data[key] = value
    return data


def record(options: RecordOptions, console: Console) -> None:
    """Record until a signal comes.

    Raises:
        OutputError: the bag cannot be made, or the disk ran full; what was recorded is whole.
    """
    started = time.monotonic()
    custom_data = parse_custom_data(options.custom_data)
    selection = Selection(frozenset(options.topics), options.include_hidden)
    stop = _StopSignal()
    with BagWriter(options.out, options.bag, custom_data) as writer:
        recorder = Recorder(writer, selection)

        def status() -> RecordingStatus:
            elapsed = time.monotonic() - started
            return RecordingStatus.of(writer, recorder.gaps, len(recorder.unusable), elapsed)

        try:
            with StatusDisplay(console, options.status_period) as display:
                while not stop.came:
                    recorder.work()
                    display.show(status)
                    time.sleep(PASS_PERIOD)
                drain(recorder)
        finally:
            writer.custom_data[MISSING_KEY] = describe_gaps(recorder.gaps)
            last = status()
            recorder.destroy_node()
    size = sum(path.stat().st_size for path in options.out.iterdir())
    console.print(last.final(options.out, size), highlight=False, markup=False)


def drain(recorder: Recorder) -> None:
    """Take what has come before the stop."""
    recorder.await_definitions()
    enough, quiet = time.monotonic() + DRAIN_TIME, 0
    # Passes are counted: for a process that was halted, time passes too.
    while quiet < QUIET_PASSES and (time.monotonic() < enough or not quiet):
        quiet = 0 if recorder.work() else quiet + 1
        time.sleep(PASS_PERIOD)
        if time.monotonic() > enough + DRAIN_TIME:  # there is always more of some topics
            return


class _StopSignal:
    """Remembers that SIGINT or SIGTERM came, so that the bag is closed in the main flow."""

    def __init__(self) -> None:
        self.came = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.came = True


def main() -> None:
    """Run from the command line."""
    arguments = remove_ros_args(sys.argv)[1:]
    options = tyro.cli(RecordOptions, prog="ros2 run sain_bags record", args=arguments)
    console = Console(soft_wrap=True)
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    try:
        record(options, console)
    except SainError as error:
        Console(stderr=True, soft_wrap=True).print(
            f"record: {error}", style="red", highlight=False, markup=False
        )
        sys.exit(1)
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
