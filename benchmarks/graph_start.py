"""How long the graph takes to start, beside four bare rclpy nodes.

From the start of the first process until every node is up, connected and recorded. The processor
time of all processes hardly depends on who else uses the machine; the wall time does.
"""

import os
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rclpy
import tyro
from rclpy.node import Node
from rich.console import Console

from sain_bringup.graph import MODEL, PLANNER, SIMULATOR, graph_commands, ros_arguments
from sain_bringup.graph_options import GraphOptions
from sain_bringup.processes import Supervisor
from sain_bringup.ros.director import Director
from sain_core.cli.terminal import FittingTable
from sain_core.ros.node_main import ros_context

BARE = "import rclpy; rclpy.init(); rclpy.spin(rclpy.create_node({name!r}))"
BARE_NAMES = [f"bare_{number}" for number in range(4)]


@dataclass(frozen=True)
class Options:
    """How the start is measured."""

    repeats: int = 5
    """Starts of each; the table has their medians."""


@dataclass(frozen=True)
class Start:
    """One start."""

    wall: float  # [s]
    processor: float  # [s], of all processes that were started


def measured(work: Callable[[Supervisor, Path], None]) -> Start:
    """Start something, and stop it when it is up."""
    with tempfile.TemporaryDirectory() as folder, Supervisor(Path(folder, "logs")) as supervisor:
        begun = time.monotonic()
        work(supervisor, Path(folder))
        wall = time.monotonic() - begun
        used = [processor_time(child.process.pid) for child in supervisor.children]
        return Start(wall, sum(used))


def processor_time(process: int) -> float:
    """Return the processor time of a process so far [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def start_graph(supervisor: Supervisor, folder: Path) -> None:
    """Start the graph as `closed_loop` does."""
    with ros_context():
        director = Director(supervisor.check, timeout=300.0)
        commands = graph_commands(GraphOptions(bag=folder / "bag"), ros_arguments(()), folder)
        for name, command in commands.items():
            supervisor.start(name, command)
        director.wait_for_graph(
            lambda: supervisor.starting((SIMULATOR, MODEL, PLANNER)), lambda missing: None
        )
        director.destroy_node()


def start_bare(supervisor: Supervisor, folder: Path) -> None:
    """Start as many nodes that do nothing."""
    with ros_context():
        observer = Node("observer")
        for name in BARE_NAMES:
            supervisor.start(name, [sys.executable, "-c", BARE.format(name=name)])
        while not set(BARE_NAMES) <= set(observer.get_node_names()):
            rclpy.spin_once(observer, timeout_sec=0.02)
        observer.destroy_node()


def main() -> None:
    """Measure and print."""
    options = tyro.cli(Options, description=__doc__)
    starts: dict[str, list[Start]] = {"graph": [], "four bare nodes": []}
    for _ in range(options.repeats):
        starts["graph"].append(measured(start_graph))
        starts["four bare nodes"].append(measured(start_bare))
    table = FittingTable(f"Start, median of {options.repeats}")
    table.add_column("")
    for column in ("wall [s]", "slowest [s]", "processor [s]"):
        table.add_column(column, justify="right")
    medians = []
    for name, found in starts.items():
        walls = [start.wall for start in found]
        medians.append(float(np.median(walls)))
        processor = float(np.median([start.processor for start in found]))
        table.add_row(name, f"{medians[-1]:.2f}", f"{max(walls):.2f}", f"{processor:.2f}")
    Console().print(table, soft_wrap=True)
    Console().print(f"ratio of the wall times: {medians[0] / medians[1]:.1f}", highlight=False)


if __name__ == "__main__":
    main()
