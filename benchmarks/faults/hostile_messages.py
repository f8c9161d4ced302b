"""Hostile messages to the nodes.

Starts each node and floods its topics, services and actions with messages that no honest sender
sends, and with text of 10 MB. The table has what was sent, what a node's callback was called with,
what was answered, what was accepted, and the node's memory before and after.
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import domain_coordinator
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from benchmarks.faults.hostile.entries import PACKAGES, Entry, entries, hostile
from benchmarks.faults.hostile.flood import AT_ONCE, Flood, Flooder
from sain_core.ros.node_main import ros_context

PARAMETERS: Final = {"model_node": ["-p", "model:=planar"]}
TEXT: Final = "x" * 10_000_000


@contextmanager
def running(name: str) -> Iterator["subprocess.Popen[bytes]"]:
    """Start a node and stop it; its log goes nowhere."""
    code = f"import sys; from {PACKAGES[name]}.commands import {name}; sys.exit({name}())"
    command = [sys.executable, "-c", code, "--ros-args", *PARAMETERS.get(name, [])]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def resident(process: "subprocess.Popen[bytes]") -> float:
    """Return the memory of a process [MB]; 0: it is no more."""
    if process.poll() is not None:
        return 0.0
    pages = int(Path(f"/proc/{process.pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@dataclass(frozen=True)
class Row:
    """What a flood of one kind did to a node."""

    entry: Entry
    kind: str
    flood: Flood
    died: bool
    before: float  # [MB] of memory
    after: float

    def __iter__(self) -> Iterator[str]:
        """Yield the cells of the table."""
        flood = self.flood
        yield f"{self.entry.name}, {self.kind}"
        for figure in (flood.sent, flood.arrived, flood.answered, flood.accepted):
            yield "-" if figure is None else str(figure)
        yield from ("yes" if self.died else "no", f"{self.before:.0f}", f"{self.after:.0f}")


def flood_node(name: str, count: int, texts: int, seed: int, rest_s: float = 0.0) -> Iterator[Row]:
    """Flood one node; yield what became of it, last after a rest [s]: results are kept for 60 s.

    Before that it does what it is for, since a first plan and a first rollout take memory to stay.
    """
    flooder, random = Flooder(name, max(count, AT_ONCE) + 100), np.random.default_rng(seed)
    taken = [one for one in entries() if one.node == name]
    with running(name) as process:
        try:
            for entry in taken:
                flooder.flood(entry, iter([entry.valid]))
            for entry in taken:
                flooder.flood(entry, spoilt(entry, 10, random))
                if entry.name in ("scene", "shapes"):  # goals are planned for in this scene
                    flooder.flood(entry, iter([entry.valid]))
                many = spoilt(entry, count, random)
                yield _flood(flooder, process, entry, "hostile", many)
                if entry.text and texts:
                    long = (with_text(entry) for _ in range(texts))
                    yield _flood(flooder, process, entry, "10 MB", long)
            if rest_s > 0.0:
                before = resident(process)
                time.sleep(rest_s)
                died = process.poll() is not None
                yield Row(entry, "at rest", Flood(), died, before, resident(process))
        finally:
            flooder.close()


def spoilt(entry: Entry, count: int, random: np.random.Generator) -> Iterator[Any]:
    """Yield hostile messages for an entry."""
    return (hostile(entry.valid, entry.fatal, random) for _ in range(count))


def _flood(
    flooder: Flooder,
    process: "subprocess.Popen[bytes]",
    entry: Entry,
    kind: str,
    messages: Iterator[Any],
) -> Row:
    before = resident(process)
    flood = flooder.flood(entry, messages)
    return Row(entry, kind, flood, process.poll() is not None, before, resident(process))


def with_text(entry: Entry) -> Any:
    """Return a valid message with text of 10 MB in it."""
    message = deepcopy(entry.valid)
    value = getattr(message, entry.text)
    if isinstance(value, str):
        setattr(message, entry.text, TEXT)
    elif isinstance(value, list):
        setattr(message, entry.text, [TEXT])
    else:
        value.frame_id = TEXT
    return message


def flood_all(names: tuple[str, ...], count: int, texts: int, seed: int) -> bool:
    """Flood the nodes one after the other; print the table; tell whether all lived."""
    table = Table()
    for column in (
        "entry",
        "sent",
        "arrived",
        "answered",
        "accepted",
        "died",
        "MB before",
        "after",
    ):
        table.add_column(column, justify="left" if column == "entry" else "right")
    alive, console = True, Console()
    with domain_coordinator.domain_id() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        with ros_context():
            for name in names:
                for row in flood_node(name, count, texts, seed):
                    table.add_row(*row)
                    sys.stderr.write(f"{' '.join(row)}\n")
                    alive = alive and not row.died
    console.print(table)
    return alive


@dataclass(frozen=True)
class Options:
    """How many messages are sent."""

    count: int = 10_000
    """to each topic, service and action"""
    texts: int = 10
    """of 10 MB, to each node"""
    nodes: tuple[str, ...] = ("sim_node", "model_node", "mppi_node")
    seed: int = 0
    """of the messages"""


def main() -> None:
    """Flood each node and print what became of it."""
    options = tyro.cli(Options, description=__doc__)
    sys.exit(0 if flood_all(options.nodes, options.count, options.texts, options.seed) else 1)


if __name__ == "__main__":
    main()
