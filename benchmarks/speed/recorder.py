"""What the recorder costs and what it loses.

1. The closed loop on the whole graph, its recorder and all, and numbered scenes at 1 kHz beside
   it: messages that are not in the bag, and the recorder's processor time beside that of a node
   with the same raw subscriptions and an empty callback, in the same run.
2. With ``--kills N``: a recorder is killed (SIGKILL) at N random times while scenes come in at
   1 kHz; what it wrote is recovered, and what is lost compared with the flush period.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from benchmarks.report import Figure, report
from sain_bags.reading.reader import Bag
from sain_bags.recovery.recovery import recover
from sain_bags.recovery.recovery_report import RecoveryOutcome
from sain_bags.writing.gaps import read_gaps
from sain_bags.writing.writer import BagConfig
from sain_core.seeding import generator

TOPIC = "/load/scene"
PATIENCE = 120.0  # [s]
MEETING = 20.0  # [s], for a recorder and a publisher
HEAD = 2000  # [bytes], a file that is larger has messages in it
TICKS = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True)
class Options:
    """How much to measure."""

    seconds: float = 60.0
    """to record the whole graph for; 0: not at all"""
    rate: float = 1000.0
    """of scenes [1/s]"""
    kills: int = 0
    """of a recorder at random times"""
    seed: int = 0
    """of these times"""
    out: Path | None = None
    """write the figures to this JSON file"""


@contextmanager
def running(*command: str) -> Iterator["subprocess.Popen[str]"]:
    """Run a process, and end it if it did not."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
            process.communicate(timeout=PATIENCE)


def part(*arguments: str) -> tuple[str, ...]:
    """Return the command of a part."""
    return (sys.executable, "-m", "benchmarks.speed.recorder_parts", *arguments)


def end(process: "subprocess.Popen[str]", number: int = signal.SIGTERM) -> str:
    """End a process with a signal; return what it said."""
    process.send_signal(number)
    return process.communicate(timeout=PATIENCE)[0]


def wait_for(process: "subprocess.Popen[str]", text: str) -> None:
    """Wait until a process says something."""
    assert process.stdout is not None
    for line in process.stdout:
        if text in line:
            return
    sys.exit(f"the process ended before it said {text!r}")


def processor_time(process_id: int) -> float:
    """Return the processor time of a process so far, all threads together [s]."""
    words = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / TICKS


def recorder_of(parent: int) -> int:
    """Return the id of the recorder that a process started."""
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            ancestor = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            command = (folder / "cmdline").read_bytes()
        except OSError:
            continue
        if ancestor == parent and b"/sain_bags/record" in command:
            return int(folder.name)
    sys.exit("no recorder among the closed loop's processes")


def whole_graph(options: Options, folder: Path) -> list[Figure]:
    """Record the closed loop and scenes at a high rate; read losses and costs."""
    out = folder / "run"
    graph = ("ros2", "run", "sain_bringup", "closed_loop", "--scenario", "anywhere", "--no-video")
    # Played without an end, it is stopped when the time is over.
    with running(*graph, "--episodes", "1000", "--out", str(out)) as loop:
        wait_for(loop, "are up")
        recorder = recorder_of(loop.pid)
        with (
            running(*part("bare")) as bare,
            running(*part("scene", str(options.rate), "2")) as load,
        ):
            time.sleep(5.0)  # all have found each other
            before = [processor_time(recorder), processor_time(bare.pid)]
            begun = time.perf_counter()
            time.sleep(options.seconds)
            passed = time.perf_counter() - begun
            after = [processor_time(recorder), processor_time(bare.pid)]
            published = int(end(load).split()[-1])
        end(loop, signal.SIGINT)
    bag = Bag(out / "bag")
    recording, peer = (np.array(after) - before) / passed
    numbers = [received.message.scene_id for received in bag.messages([TOPIC])]
    if numbers != sorted(numbers):
        sys.exit("the scenes are not in their order")
    missing = read_gaps(bag.custom_data)
    if missing is None:
        sys.exit("the bag does not say what is missing")
    size = sum(path.stat().st_size for path in (out / "bag").glob("*.mcap"))
    return [
        Figure(f"{published:,} scenes at {options.rate:g} Hz, lost", published - len(numbers), "",
               at_most=0),
        Figure("topics of which a sequence number is missing", len(missing), "", at_most=0),
        Figure(f"messages in {bag.duration:.0f} s on {len(bag.topics)} topics",
               bag.message_count, ""),
        Figure("size of the bag", size / 1e6, "MB"),
        Figure("processor, recorder", 100 * recording, "% of a core"),
        Figure("processor, bare raw subscriptions", 100 * peer, "% of a core"),
        Figure("recorder / bare", recording / peer, "", at_most=1.3),
    ]  # fmt: skip


@dataclass(frozen=True)
class Kill:
    """What became of one recording that was killed."""

    lost: float  # [s], from the last message that was saved to the kill
    saved: int
    is_conditioned: bool  # that something is lost, or that nothing could be saved
    holes: int  # messages that are missing before the last one that was saved
    deaf: int  # recorders before it that heard nothing


def started(bag: Path) -> "subprocess.Popen[bytes] | None":
    """Start a recorder; None where it heard nothing, as may be after the one before was killed."""
    command = ("ros2", "run", "sain_bags", "record", "--out", str(bag), "--topics", TOPIC)
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    deadline = time.monotonic() + MEETING
    file = bag / f"{bag.name}_0.mcap"
    while not (file.exists() and file.stat().st_size > HEAD):
        if process.poll() is not None:
            sys.exit(f"the recorder ended before it was killed: {process.returncode}")
        if time.monotonic() > deadline:
            process.kill()
            process.wait()
            return None
        time.sleep(0.01)
    return process


def kill_once(folder: Path, delay: float) -> Kill:
    """Kill a recorder some time after its first chunk, and recover what it wrote."""
    tries = 0
    while (process := started(folder / f"bag_{tries}")) is None:
        tries += 1
    bag, saved = folder / f"bag_{tries}", folder / "saved"
    time.sleep(delay)
    killed = time.time_ns()
    process.kill()
    process.wait()
    report = recover(bag, saved)
    if report.outcome == RecoveryOutcome.NOTHING:
        return Kill(float("inf"), 0, True, 0, tries)
    messages = [received.message.scene_id for received in Bag(saved).messages([TOPIC])]
    holes = int(messages[-1] - messages[0] + 1 - len(messages))
    told = report.outcome == RecoveryOutcome.LOSSY and "was not closed" in report.sidecar.note
    return Kill(1e-9 * (killed - report.span.end), len(messages), told, holes, tries)


def kills(options: Options, folder: Path) -> list[Figure]:
    """Kill recorders at random times."""
    random, found = generator(options.seed, "kills"), []
    with running(*part("scene", str(options.rate), "0")) as load:
        for number in range(options.kills):
            place = folder / f"kill_{number}"
            place.mkdir()
            found.append(kill_once(place, float(random.uniform(0.0, 5.0))))
            print(f"kill {number + 1}: {found[-1]}", flush=True)
        end(load)
    period = BagConfig().flush_period
    untold = sum(not kill.is_conditioned for kill in found)
    return [
        Figure(f"recordings killed: {len(found)}, losses not told of", untold, "", at_most=0),
        Figure("lost, longest", max(kill.lost for kill in found), "s", at_most=period),
        Figure("lost, mean", float(np.mean([kill.lost for kill in found])), "s"),
        Figure("messages missing before", sum(kill.holes for kill in found), "", at_most=0),
        Figure("messages saved", sum(kill.saved for kill in found), ""),
        Figure("recorders that heard nothing", sum(kill.deaf for kill in found), ""),
    ]


def main() -> None:
    """Measure what the recorder costs, and what it loses."""
    import domain_coordinator  # needs the middleware

    options = tyro.cli(Options, description=__doc__)
    figures = []
    temporary = tempfile.TemporaryDirectory(prefix="sain-bench-")
    with temporary as folder, domain_coordinator.domain_id() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        if options.seconds:
            figures += whole_graph(options, Path(folder))
        if options.kills:
            figures += kills(options, Path(folder))
    figures.append(Figure("load average meanwhile", os.getloadavg()[0], ""))
    report("The recorder", figures, options.out)


if __name__ == "__main__":
    main()
