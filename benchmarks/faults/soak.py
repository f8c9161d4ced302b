"""An hour of closed loop: memory, threads, descriptors and lost messages.

The memory of the last quarter is compared with that of the second: in the first, caches fill.
"""

import os
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
import tyro
from rich.console import Console

from benchmarks.faults.running import Graph, graph
from sain_bags.bag.metadata import read_metadata
from sain_bags.writing.gaps import MISSING_KEY
from sain_bringup.graph import GraphOptions
from sain_core.cli.terminal import FittingTable
from sain_core.guarding.documents import parse_json

PERIOD: Final = 10.0  # [s] between looks
SHARED: Final = Path("/dev/shm")


@dataclass(frozen=True)
class Options:
    """How long."""

    minutes: float = 60.0
    pace: float = 1.0
    """simulated time over wall time; 0: as fast as possible"""


@dataclass
class Watch:
    """What processes use, from look to look."""

    running: Graph
    looks: dict[str, list[tuple[float, ...]]] = field(default_factory=dict)
    shared: list[int] = field(default_factory=list)
    next_look: float = 0.0

    def look(self) -> None:
        """Look if it is time: memory [MB], threads and descriptors."""
        if time.monotonic() < self.next_look:
            return
        self.next_look = time.monotonic() + PERIOD
        self.shared.append(sum(1 for _ in SHARED.iterdir()))
        for child in self.running.supervisor.children:
            place = Path("/proc", str(child.process.pid))
            pages = int((place / "statm").read_text().split()[1])
            memory = pages * os.sysconf("SC_PAGE_SIZE") / 1e6
            counts = [sum(1 for _ in (place / kind).iterdir()) for kind in ("task", "fd")]
            self.looks.setdefault(child.name, []).append((memory, *counts))


def main() -> None:
    """Play, watch and print."""
    options = tyro.cli(Options, description=__doc__)
    console, end = Console(), time.monotonic() + 60.0 * options.minutes
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        settings = folder / "settings.yaml"
        settings.write_text(
            f"/**/sim_node: {{ros__parameters: {{real_time_factor: {options.pace}}}}}\n"
        )
        reached = episodes = 0
        given = GraphOptions(bag=folder / "bag", params_file=settings)
        with graph(folder, given) as running:
            watch = Watch(running)
            running.interference = watch.look
            while time.monotonic() < end:
                reached += running.play().reached
                episodes += 1
        missing = parse_json(read_metadata(folder / "bag")["custom_data"][MISSING_KEY])
    table = FittingTable()
    for column in ("process", "MB", "later", "growth", "threads", "descriptors"):
        table.add_column(column, "left" if column == "process" else "right")
    for process, looks in watch.looks.items():
        table.add_row(process, *cells(np.array(looks)))
    console.print(table, soft_wrap=True)
    restarts = len(running.told)
    console.print(
        f"{options.minutes:g} min, {episodes:,} episodes, {reached:,} reached, {restarts} restarts;"
        f" files in /dev/shm: {watch.shared[0]} to {watch.shared[-1]}; missing: {missing or 'none'}"
    )


def cells(looks: np.ndarray) -> list[str]:
    """Return the cells about one process: looks (T, 3) of memory, threads and descriptors."""
    quarter = max(len(looks) // 4, 1)
    before, after = looks[quarter : 2 * quarter], looks[-quarter:]
    first, last = np.median(before[:, 0]), np.median(after[:, 0])
    counts = [f"{int(before[:, i].max())} to {int(after[:, i].max())}" for i in (1, 2)]
    return [f"{first:.0f}", f"{last:.0f}", f"{last / first - 1.0:+.1%}", *counts]


if __name__ == "__main__":
    main()
