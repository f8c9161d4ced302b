"""What the graph makes of faults; ``make faults`` writes docs/reference/faults.md.

Killed and stopped processes, lost and late datagrams, jumps of the wall clock, full memory and
full disks. All of it is done below the nodes, which are those that users run.
"""

import json
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import tyro
from rich.console import Console

from benchmarks.faults import hostile_files
from benchmarks.faults.arm_faults import arm_faults
from benchmarks.faults.hostile_files import run_files
from benchmarks.faults.hostile_messages import flood_node
from benchmarks.faults.running import PARTS, Strikes, graph, lost_rows, own_domain
from benchmarks.faults.surroundings import (
    clock_jumps,
    datagrams,
    disks,
    full_memory,
    with_own_memory,
)
from benchmarks.faults.table import Row, show, write_page
from sain_bags.reading.reader import Bag
from sain_bringup.graph import LEARNER, MODEL, RECORDER, GraphOptions
from sain_core.output import claim_file
from sain_core.ros.node_main import ros_context
from sain_lab.keeping.laboratory import Laboratory

RESULTS_KEPT: Final = 60.0  # [s], of actions
STOPPED: Final = 10.0  # [s]
LEARNING: Final = (LEARNER, MODEL)  # processes that are struck while a learner is at work
KINDS: Final = ("kill", "stop", "datagrams", "clock", "memory", "disk", "messages", "files", "arm")


@dataclass(frozen=True)
class Options:
    """How often each fault is tried."""

    kills: int = 50
    """of each process"""
    stops: int = 10
    """of each process, for 10 s"""
    episodes: int = 20
    """with each fault of the surroundings"""
    disks: int = 3
    """of each kind"""
    messages: int = 10_000
    """to each topic, service and action, hostile ones"""
    files: int = 1000
    """hostile ones"""
    arm: int = 20
    """of a table with a robot arm, each"""
    arm_only: str = ""
    """words in the names of those faults; empty: all of them"""
    only: tuple[str, ...] = KINDS
    """kinds of faults"""
    parts: tuple[str, ...] = (*PARTS, LEARNER)
    """processes to kill and to stop"""
    page: Path | None = None
    """Markdown page to write"""
    overwrite: bool = False
    """replace a page that others wrote, such as docs/reference/faults.md"""
    rows: Path | None = None
    """JSON lines that rows are added to; the page has all that are there, also from before"""
    seed: int = 0


def strikes(
    folder: Path, kind: str, tries: int, seed: int, parts: Sequence[str] = PARTS
) -> Iterator[Row]:
    """Kill or stop each process in turn."""
    for name in parts:
        place = folder / f"{kind}_{name}"
        laboratory = place / "laboratory" if name in LEARNING else None
        options = GraphOptions(bag=place / "bag", learn=str(laboratory or ""))
        with graph(place, options) as running:
            striking = Strikes(running, kill if kind == "kill" else stop, name, seed)
            striking.repeat(tries)
        observed = running.observed
        lost = observed.twice + observed.broken
        if lost:
            print(f"{name}: {observed.twice} executed twice, {observed.broken} broken", flush=True)
        lost += lost_rows(Bag(place / "bag"), observed, striking.spared if name == RECORDER else [])
        if laboratory is not None:
            lost += learned_twice(laboratory)
        word = "SIGKILL" if kind == "kill" else f"SIGSTOP for {STOPPED:g} s"
        yield Row(f"{word}: {name}", tries, striking.survived, lost, striking.recoveries)


def learned_twice(path: Path) -> int:
    """Return how many pushes are in a laboratory more than once; raises where it is not whole."""
    digests = [one["digest"] for one in Laboratory(path).records() if one["kind"] == "push"]
    print(f"{path}: {len(digests)} pushes were learned from", flush=True)
    return len(digests) - len(set(digests))


def kill(process: int) -> None:
    """Kill a process."""
    os.kill(process, signal.SIGKILL)


def stop(process: int) -> None:
    """Stop a process for some time."""
    os.kill(process, signal.SIGSTOP)

    def go_on() -> None:
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGCONT)

    threading.Timer(STOPPED, go_on).start()


def measure(options: Options, folder: Path) -> Iterator[Row]:
    """Yield the rows of the table, one after the other."""
    given: dict[str, Callable[[], Iterator[Row]]] = {
        "kill": lambda: strikes(folder, "kill", options.kills, options.seed, options.parts),
        "stop": lambda: strikes(folder, "stop", options.stops, options.seed, options.parts),
        "datagrams": lambda: datagrams(folder, options.episodes),
        "clock": lambda: clock_jumps(folder, options.episodes),
        "memory": lambda: memory(folder, options.episodes),
        "disk": lambda: disks(folder, options.disks),
        "messages": lambda: messages(options.messages, options.seed),
        "arm": lambda: arm_faults(folder, options.arm, options.arm_only),
        "files": lambda: files(folder, options.files, options.seed),
    }
    for kind in options.only:
        yield from given[kind]()


def memory(folder: Path, episodes: int) -> Iterator[Row]:
    """Measure in a process that has a /dev/shm of its own."""
    rows = folder / "memory.json"
    command = [sys.executable, "-m", "benchmarks.faults.graph_faults", "--only", "_memory"]
    with_own_memory([*command, "--episodes", str(episodes), "--rows", str(rows)])
    for line in rows.read_text().splitlines():
        yield Row(**json.loads(line))


def messages(count: int, seed: int) -> Iterator[Row]:
    """Flood each node with hostile messages, and with texts of 10 MB."""
    for name in ("sim_node", "model_node", "mppi_node"):
        with own_domain(), ros_context():
            found = list(flood_node(name, count, 10, seed, rest_s=RESULTS_KEPT + 10.0))
        arrived = sum(one.flood.arrived or 0 for one in found)
        asked = [one.flood for one in found if one.flood.answered is not None]
        silent = sum(max((one.arrived or 0) - (one.answered or 0), 0) for one in asked)
        grown = found[-1].after - found[0].before
        note = f"survived: answered, or ignored with a warning; memory grew by {grown:.0f} MB"
        died = sum(one.died for one in found)
        yield Row(f"hostile messages: {name}", arrived, arrived - silent, died, note=note)


def files(folder: Path, count: int, seed: int) -> Iterator[Row]:
    """Read hostile files with every command that reads files."""
    console = Console(stderr=True)
    found = list(run_files(hostile_files.Options(count=count, seed=seed), folder, console))
    right = sum(one.is_right for one in found)
    memory = max(one.found.megabytes for one in found)
    seconds = max(one.found.seconds for one in found)
    note = f"survived: read or refused in one line; at most {memory:.0f} MB and {seconds:.1f} s"
    yield Row(f"{count:,} hostile files", len(found), right, 0, note=note)


def main() -> None:
    """Measure, print and write."""
    options = tyro.cli(Options, description=__doc__)
    console, rows = Console(), []
    if options.page is not None:
        claim_file(options.page, options.overwrite)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.only == ("_memory",):
            measured: Iterator[Row] = full_memory(folder, options.episodes)
        else:
            measured = measure(options, folder)
        for row in measured:
            rows.append(row)
            show([row], console)
            if options.rows is not None:
                with options.rows.open("a") as file:
                    file.write(json.dumps(asdict(row)) + "\n")
    if options.page is not None:
        if options.rows is not None:
            rows = [Row(**json.loads(line)) for line in options.rows.read_text().splitlines()]
        write_page(options.page, rows, "make faults")
    sys.exit(0 if all(row.is_well for row in rows) else 1)


if __name__ == "__main__":
    main()
