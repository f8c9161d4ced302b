"""Faults of what is below all processes: datagrams, the wall clock, memory and disks."""

import shlex
import struct
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from benchmarks.faults.running import graph
from benchmarks.faults.table import Row
from sain_bags.reading.reader import Bag
from sain_bringup.children import ProcessDiedError, RestartLimits
from sain_bringup.graph import GraphOptions, executable
from sain_core.errors import SainError
from sain_core.guarding.lifetime import SHARED

SOURCE: Final = Path(__file__).with_suffix(".c")
DATAGRAMS: Final = {
    "5 % of datagrams lost": {"FAULT_DROP": "0.05"},
    "10 % of datagrams late by 20 ms": {"FAULT_DELAY": "0.1", "FAULT_LATE": "20000"},
}
JUMPS: Final = {"wall clock jumps ahead by 1 h": 3600.0, "wall clock jumps back by 1 h": -3600.0}
SMALL: Final = "2m"  # disk
STARTS: Final = 5


def compiled(folder: Path) -> Path:
    """Compile what is loaded into the processes; return its path."""
    library = folder / "surroundings.so"
    command = ["gcc", "-O2", "-shared", "-fPIC", "-o", str(library), str(SOURCE), "-ldl"]
    subprocess.run(command, check=True)
    return library


def played(
    folder: Path,
    fault: str,
    episodes: int,
    environment: dict[str, str],
    begin: Callable[[], object] = lambda: None,
) -> Row:
    """Play episodes on a graph whose processes have these variables; `begin` after the first."""
    survived = 0
    with graph(folder, environment=environment) as running:
        for number in range(episodes):
            if number == 1:
                begin()
            try:
                running.play()
                survived += 1
            except SainError as error:
                print(f"{fault}: {error}", flush=True)
    observed = running.observed
    return Row(fault, episodes, survived, observed.twice + observed.broken)


def datagrams(folder: Path, episodes: int) -> Iterator[Row]:
    """Lose datagrams, and let them be late."""
    library = str(compiled(folder))
    for number, (fault, settings) in enumerate(DATAGRAMS.items()):
        environment = {"LD_PRELOAD": library, **settings}
        yield played(folder / f"datagrams_{number}", fault, episodes, environment)


def worst_datagrams(folder: Path, episodes: int) -> Row:
    """Lose some datagrams and delay others, in one graph."""
    environment = {"LD_PRELOAD": str(compiled(folder))}
    for settings in DATAGRAMS.values():
        environment |= settings
    return played(folder / "datagrams", ", ".join(DATAGRAMS), episodes, environment)


def clock_jumps(folder: Path, episodes: int) -> Iterator[Row]:
    """Let the wall clock jump between the first episode and the second."""
    library = str(compiled(folder))
    for fault, jump in JUMPS.items():
        clock = folder / f"clock_{jump:g}"
        clock.write_bytes(struct.pack("d", 0.0))
        environment = {"LD_PRELOAD": library, "FAULT_CLOCK": str(clock)}

        def leap(clock: Path = clock, jump: float = jump) -> None:
            with clock.open("r+b") as file:
                file.write(struct.pack("d", jump))

        yield played(folder / f"jump_{jump:g}", fault, episodes, environment, leap)


def full_memory(folder: Path, episodes: int) -> Iterator[Row]:
    """Let /dev/shm, of which this process has its own, run full in the midst of episodes."""

    def fill() -> None:
        with suppress(OSError), (SHARED / "full").open("wb", buffering=0) as file:
            while True:
                file.write(bytes(1 << 12))

    yield played(folder / "memory", "/dev/shm runs full", episodes, {}, fill)
    refused = 0
    for _ in range(STARTS):
        command = [str(executable("sain_sim", "sim_node"))]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        refused += done.returncode == 1 and f"sim_node: {SHARED} is full" in done.stderr
    note = "ROS itself cannot start there: a node says so and ends with exit code 1"
    yield Row("start with full /dev/shm", STARTS, refused, 0, note=note)


def disks(folder: Path, tries: int) -> Iterator[Row]:
    """Record to a disk that runs full, and to one that cannot be written."""
    for fault, options in (("disk runs full", SMALL), ("disk is read-only", "ro")):
        ended, whole = 0, 0
        for number in range(tries):
            place = folder / f"{options}_{number}"
            with mounted(place, options):
                ended += _ends_with_a_reason(folder / f"logs_{options}_{number}", place)
                whole += _is_whole(place / "bag")
        note = "the graph ends with the reason; what was recorded is whole"
        yield Row(fault, tries, ended, tries - whole, note=note)


def _ends_with_a_reason(folder: Path, place: Path) -> bool:
    try:
        with graph(folder, GraphOptions(bag=place / "bag"), restarts=RestartLimits()) as running:
            for _ in range(1000):
                running.play()
    except ProcessDiedError as error:
        return (
            "space" in str(error) or "left on the disk" in str(error) or "Read-only" in str(error)
        )
    return False


def _is_whole(bag: Path) -> bool:
    if not bag.exists():
        return True
    Bag(bag).check()
    return True


@contextmanager
def mounted(place: Path, options: str) -> Iterator[None]:
    """Mount a small disk of memory at a place."""
    place.mkdir(parents=True)
    size = "ro" if options == "ro" else f"size={options}"
    subprocess.run(["mount", "-t", "tmpfs", "-o", size, "tmpfs", str(place)], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


def with_own_memory(command: Sequence[str]) -> int:
    """Run a command that has a small /dev/shm of its own; return its exit code."""
    script = f"mount -t tmpfs -o size=1m tmpfs {SHARED} && exec {shlex.join(command)}"
    return subprocess.run(["unshare", "-m", "sh", "-c", script], check=False).returncode
