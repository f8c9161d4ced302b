"""What the graph makes of faults; ``make faults`` writes results/faults.md.

Killed and stopped processes, hostile input, and faults of a table with an arm. All of it is done
below the nodes, which are those that users run.
"""

import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import tyro
from rich.console import Console

from benchmarks.faults.arm_faults import arm_faults
from benchmarks.faults.hostile import PACKAGES, files, messages
from benchmarks.faults.running import PARTS, Strikes, graph, lost_rows, strike
from benchmarks.faults.table import Row, show, write_page
from sain_bags.reading.reader import Bag
from sain_bringup.graph import LEARNER, MODEL, PLANNER, RECORDER, GraphOptions
from sain_core.output import claim_file
from sain_lab.storage.laboratory import Laboratory

STOPPED: Final = 10.0  # [s]
LEARNING: Final = (LEARNER, MODEL)  # processes that are struck while a learner is at work
KINDS: Final = ("kill", "stop", "policy", "messages", "files", "arm")
POLICY: Final = "tests.policies:straight"


@dataclass(frozen=True)
class Options:
    """How often each fault is tried."""

    kills: int = 50
    """of each process"""
    stops: int = 10
    """of each process, for 10 s"""
    messages: int = 1000
    """to each topic and service, spoilt ones"""
    files: int = 1000
    """mutated ones"""
    arm: int = 20
    """of a table with a robot arm, each"""
    words: tuple[str, ...] = ("",)
    """in the names of those"""
    only: tuple[str, ...] = KINDS
    """kinds of faults"""
    parts: tuple[str, ...] = (*PARTS, LEARNER)
    """processes to kill and to stop"""
    page: Path | None = None
    """Markdown page to write"""
    overwrite: bool = False
    """replace a page that others wrote, such as docs/reference/faults.md"""
    seed: int = 0


def strikes(
    folder: Path,
    kind: str,
    tries: int,
    seed: int,
    parts: Sequence[str] = PARTS,
    policy: str = "",
) -> Iterator[Row]:
    """Kill or stop each process in turn, while the planner or a policy chooses pushes."""
    for name in parts:
        place = folder / f"{kind}_{name}"
        laboratory = place / "laboratory" if name in LEARNING else None
        options = GraphOptions(bag=place / "bag", learn=str(laboratory or ""), policy=policy)
        with graph(place, options) as running:
            striking = Strikes(
                running, partial(strike, stopped=STOPPED * (kind == "stop")), name, seed
            )
            striking.repeat(tries)
        observed = running.observed
        lost = observed.twice + observed.broken
        lost += lost_rows(Bag(place / "bag"), observed, striking.spared if name == RECORDER else [])
        if laboratory is not None:
            lost += learned_twice(laboratory)
        word = f"SIGSTOP for {STOPPED:g} s" if kind == "stop" else "SIGKILL"
        more = ", with a policy" if policy else ""
        yield Row(f"{word}: {name}{more}", tries, striking.survived, lost, striking.recoveries)


def learned_twice(path: Path) -> int:
    """Return how many pushes are in a laboratory more than once; raises where it is not whole."""
    digests = [one["digest"] for one in Laboratory(path).records() if one["kind"] == "push"]
    return len(digests) - len(set(digests))


def measure(options: Options, folder: Path) -> Iterator[Row]:
    """Yield the rows of the table, one after the other."""
    given: dict[str, Callable[[], Iterator[Row]]] = {
        "kill": lambda: strikes(folder, "kill", options.kills, options.seed, options.parts),
        "stop": lambda: strikes(folder, "stop", options.stops, options.seed, options.parts),
        "policy": lambda: strikes(
            folder, "policy", options.kills, options.seed, (PLANNER, RECORDER), POLICY
        ),
        "messages": lambda: (messages(one, options.messages, options.seed) for one in PACKAGES),
        "files": lambda: iter([files(folder, options.files, options.seed)]),
        "arm": lambda: arm_faults(folder, options.arm, options.words),
    }
    for kind in options.only:
        yield from given[kind]()


def main() -> None:
    """Measure, print and write."""
    options = tyro.cli(Options, description=__doc__)
    console, rows = Console(), []
    if options.page is not None:
        claim_file(options.page, options.overwrite)
    with tempfile.TemporaryDirectory() as name:
        for row in measure(options, Path(name)):
            rows.append(row)
            show([row], console)
    if options.page is not None:
        write_page(options.page, rows, "make faults")
    sys.exit(0 if all(row.is_well for row in rows) else 1)


if __name__ == "__main__":
    main()
