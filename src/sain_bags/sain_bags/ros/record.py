"""``ros2 run sain_bags record``: records topics to a bag, those that appear late too."""

import json
import signal
import time
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import tyro
from rich.console import Console

from sain_bags.bag.parts import check_parts
from sain_bags.mcap.integrity import rescue
from sain_bags.recovery import make_whole
from sain_bags.ros.stop_signal import StopSignal
from sain_bags.writing.gaps import MISSING_KEY, SILENT_KEY, UNRECORDED_KEY, describe_gaps
from sain_bags.writing.recording_status import RecordingStatus, StatusDisplay
from sain_bags.writing.selection import Selection
from sain_bags.writing.writer import BagConfig, BagWriter
from sain_core.config import Config, option, required
from sain_core.errors import ConfigError, OutputError, SainError
from sain_core.guarding import lifetime
from sain_core.guarding.lifetime import release

if TYPE_CHECKING:
    from sain_bags.ros.recorder import Recorder

PASS_PERIOD: Final = 0.01  # [s] between passes over all topics, also how soon a signal is noticed
DRAIN_PASSES: Final = 30  # after the stop: a packet that got lost is sent again within some 0.1 s
DRAIN_TIME: Final = 1.0  # [s], at most: there is always more of some topics ...
LEAST_PASSES: Final = 5  # ... but for so many passes
BEAT_PERIOD: Final = 0.1  # [s] between signs of life while files are ended
SILENCE: Final = 5.0  # [s] after which nothing seems to be published
REST: Final = 0.5  # [s] from the first message until the other topics are discovered, too
PATIENCE: Final = 3.0  # [s] then, at most, until all publishers are connected


@dataclass(frozen=True)
class RecordOptions(Config):
    """Record a running graph to a bag (rosbag2 layout, MCAP).

    All topics but images are recorded, also those that appear later, with their definitions;
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
    images: bool = option(False, "record images, too: tens of megabytes a second")
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


def parse_custom_data(pairs: tuple[str, ...]) -> dict[str, str]:
    """Return ``KEY=VALUE`` words as a dictionary."""
    data = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not key or not equals:
            raise ConfigError(f"custom data is {pair!r}; it must be KEY=VALUE")
        data[key] = value
    return data


def run(options: RecordOptions, console: Console) -> None:
    """Record until a signal comes.

    Raises:
        OutputError: the bag cannot be made, or the disk ran full; what was recorded is whole.
    """
    from sain_core.ros.node_main import ros_context

    console.soft_wrap = True
    if options.resume:
        check_parts(options.out)
    try:
        with ros_context():
            record(options, console)
        if options.resume:
            end_parts(options.out, console)
    except SainError as error:
        if not options.resume:
            raise
        raise OutputError(f"{error}; its files are left: {rescue(options.out)}") from error


def end_parts(out: Path, console: Console) -> None:
    """End the files that a crash has cut off, unless another signal comes, and so the bag."""
    doing = "ending the files that were cut off"
    console.print(f"{doing}; Ctrl-C leaves them", highlight=False)
    lifetime.stopping(doing)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    next_beat = 0.0

    def advance(read: int) -> None:
        nonlocal next_beat
        if (now := time.monotonic()) >= next_beat:
            next_beat = now + BEAT_PERIOD
            lifetime.alive()

    try:
        make_whole(out, advance)
    except KeyboardInterrupt:
        raise OutputError("a signal ended the recorder before its bag was whole") from None
    console.print(f"One bag with what was recorded before: {out}", highlight=False)


def record(options: RecordOptions, console: Console) -> None:
    """Record until a signal comes; rclpy is initialised. Raises as `run`."""
    from sain_bags.ros.recorder import Recorder

    started = time.monotonic()
    custom_data = parse_custom_data(options.custom_data)
    selection = Selection(frozenset(options.topics), options.include_hidden, options.images)
    stop = StopSignal()
    with (
        ExitStack() as afterwards,  # once the bag is closed
        BagWriter(options.out, options.bag, custom_data, resumes=options.resume) as writer,
    ):
        recorder = Recorder(writer, selection)
        afterwards.callback(release, recorder)

        def status() -> RecordingStatus:
            known = recorder.gaps, recorder.unusable, recorder.awaited
            return RecordingStatus(writer, *known, time.monotonic() - started)

        try:
            with StatusDisplay(console, options.status_period) as display:
                readiness = Readiness(recorder, started)
                while not stop.wait(PASS_PERIOD):
                    readiness.work(recorder.work())
                    lifetime.alive()
                    display.show(status)
                lifetime.stopping("closing the recording")
                drain(recorder)
        finally:
            writer.custom_data[MISSING_KEY] = describe_gaps(recorder.gaps)
            last = status()
            writer.custom_data.update(about_silence(recorder, last.silent))
    size = sum(path.stat().st_size for path in options.out.iterdir())
    console.print(last.final(options.out, size), highlight=False, markup=False)


class Readiness:
    """Reports to the supervisor, once, that all that is published is recorded."""

    def __init__(self, recorder: "Recorder", started: float) -> None:
        """Wait from `started` [s] of `time.monotonic`."""
        self._recorder, self._due, self.reported = recorder, started + SILENCE, False

    def work(self, written: int) -> None:
        """Look whether it is so; `written` is the number of messages of the last pass."""
        now = time.monotonic()
        if written:
            self._due = min(self._due, now + REST)
        if self.reported or now < self._due:
            return
        unmatched = self._recorder.unmatched
        if unmatched and now < self._due + PATIENCE:
            return
        if unmatched:
            names = ", ".join(unmatched)
            text = f"not all publishers of {names} are connected; messages may be missing"
            self._recorder.get_logger().warning(text)
        self.reported = True
        lifetime.ready()


def about_silence(recorder: "Recorder", silent: tuple[str, ...]) -> dict[str, str]:
    """Return the custom data about topics without messages, and those not recorded."""
    found = {SILENT_KEY: silent, UNRECORDED_KEY: tuple(recorder.unusable)}
    return {key: json.dumps(topics) for key, topics in found.items() if topics}


def drain(recorder: "Recorder") -> None:
    """Take what was said before the stop, also what comes late."""
    begun, passes, taken = time.monotonic(), 0, 0
    # Passes are counted, too: for a process that was halted, time passes as well.
    while passes < LEAST_PASSES or (
        (passes < DRAIN_PASSES or taken) and time.monotonic() < begun + DRAIN_TIME
    ):
        taken = recorder.work()
        passes += 1
        time.sleep(PASS_PERIOD)
