"""What the graph makes of faults: ``make faults`` prints a table and writes docs/faults.md.

Killed and stopped processes, lost and late datagrams, jumps of the wall clock, full memory and
full disks. All of it is done below the nodes, which are those that users run.
"""

import json
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

import tyro
from rich.console import Console

from benchmarks.faults.running import PARTS, Strikes, graph, lost_rows
from benchmarks.faults.surroundings import (
    clock_jumps,
    datagrams,
    disks,
    full_memory,
    in_full_memory,
)
from benchmarks.faults.table import Row, show, write_page
from sain_bags.reading.reader import Bag
from sain_bringup.graph import RECORDER

STOPPED: Final = 10.0  # [s]
KINDS: Final = ("kill", "stop", "datagrams", "clock", "memory", "disk")


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
    only: tuple[str, ...] = KINDS
    """kinds of faults"""
    page: Path | None = None
    """Markdown page to write"""
    rows: Path | None = None
    """JSON lines that keep rows which were measured; these are not measured again"""
    seed: int = 0


def strikes(folder: Path, kind: str, tries: int, seed: int) -> Iterator[Row]:
    """Kill or stop each process in turn."""
    for name in PARTS:
        place = folder / f"{kind}_{name}"
        with graph(place) as running:
            striking = Strikes(running, kill if kind == "kill" else stop, name, seed)
            striking.repeat(tries)
        observed = running.observed
        lost = observed.twice + observed.broken
        lost += lost_rows(Bag(place / "bag"), observed, striking.spared if name == RECORDER else [])
        word = "SIGKILL" if kind == "kill" else f"SIGSTOP for {STOPPED:g} s"
        yield Row(f"{word}: {name}", tries, striking.survived, lost, striking.recoveries)


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
        "kill": lambda: strikes(folder, "kill", options.kills, options.seed),
        "stop": lambda: strikes(folder, "stop", options.stops, options.seed),
        "datagrams": lambda: datagrams(folder, options.episodes),
        "clock": lambda: clock_jumps(folder, options.episodes),
        "memory": lambda: memory(folder, options.episodes),
        "disk": lambda: disks(folder, options.disks),
    }
    for kind in options.only:
        yield from given[kind]()


def memory(folder: Path, episodes: int) -> Iterator[Row]:
    """Measure in a process that has a full /dev/shm of its own."""
    rows = folder / "memory.json"
    command = [sys.executable, "-m", "benchmarks.graph_faults", "--only", "_memory"]
    in_full_memory([*command, "--episodes", str(episodes), "--rows", str(rows)])
    for line in rows.read_text().splitlines():
        yield Row(**json.loads(line))


def main() -> None:
    """Measure, print and write."""
    options = tyro.cli(Options, description=__doc__)
    console, rows = Console(), []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.only == ("_memory",):
            measured: Iterator[Row] = iter([full_memory(folder, options.episodes)])
        else:
            measured = measure(options, folder)
        for row in measured:
            rows.append(row)
            show([row], console)
            if options.rows is not None:
                with options.rows.open("a") as file:
                    file.write(json.dumps(asdict(row)) + "\n")
    if options.page is not None:
        write_page(options.page, rows, "make faults")
    sys.exit(0 if all(row.is_well for row in rows) else 1)


if __name__ == "__main__":
    main()
