"""Hostile files through the commands that read files.

Each file is of a named family: a mutation of a good file, or a bomb. Each command runs in a process
of its own. Right is that it reads the file, or refuses it with one line and exit code 1 or 2, in at
most 10 s of the processor and 1 GB; none runs for longer than 60 s.
"""

import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import tyro
from rich.console import Console

from benchmarks.faults.hostile.bag_families import BAGS
from benchmarks.faults.hostile.bags import Make
from benchmarks.faults.hostile.commands import commands
from benchmarks.faults.hostile.file_families import CHECKPOINTS, DATA, JSONS, PARAMETERS
from benchmarks.faults.hostile.goods import SUFFIXES, Goods
from benchmarks.faults.hostile.measuring import READ, REFUSED, Measured, measure
from sain_core.randomness import generator

KINDS: Final[dict[str, dict[str, Make]]] = {
    "bag": BAGS,
    "checkpoint": CHECKPOINTS,
    "belief": JSONS,
    "data": DATA,
    "results": JSONS,
    "parameters": PARAMETERS,
}
MOST_SECONDS: Final = 10.0
MOST_MB: Final = 1000.0
RANDOM: Final = ("mutated", "wrong kinds")  # of these families no two files are the same


@dataclass(frozen=True)
class Options:
    """How many files, and which."""

    count: int = 1000
    """of files, over all kinds and families; of each family one at least"""
    seed: int = 0
    """of mutations"""
    kinds: tuple[str, ...] = tuple(KINDS)
    """of files"""
    families: tuple[str, ...] = ()
    """only those whose names contain one of these; none: all"""


@dataclass(frozen=True)
class HostileFile:
    """One file to make."""

    kind: str
    family: str
    number: int  # among those of its family

    @property
    def make(self) -> Make:
        """What makes it."""
        return KINDS[self.kind][self.family]


@dataclass(frozen=True)
class Outcome:
    """What one command did with one file."""

    file: HostileFile
    command: str
    found: Measured

    @property
    def is_right(self) -> bool:
        """Whether the file was read or refused, soon and with little memory."""
        found = self.found
        within = found.seconds <= MOST_SECONDS and found.megabytes <= MOST_MB
        return found.state in (READ, REFUSED) and within

    @property
    def summary(self) -> str:
        """What it did, in a few lines."""
        file, found = self.file, self.found
        lines = found.text.strip().splitlines()
        return (
            f"{file.kind}, {file.family} {file.number}: {self.command}: {found.state} {found.code},"
            f" {found.megabytes:.0f} MB, {found.seconds:.1f} s: {' / '.join(lines[-2:])[:400]}"
        )


def choose_files(options: Options) -> Iterator[HostileFile]:
    """Yield each family once, then those that differ each time, in turn; kind by kind."""
    named = [
        HostileFile(kind, family, 0)
        for kind in options.kinds
        for family in KINDS[kind]
        if not options.families or any(part in family for part in options.families)
    ]
    random = [file for file in named if file.family.endswith(RANDOM)]
    more = max(options.count - len(named), 0) if random else 0
    files = list(named)
    for number in range(more):
        turn, place = divmod(number, len(random))
        files.append(HostileFile(random[place].kind, random[place].family, turn + 1))
    yield from sorted(files, key=lambda file: options.kinds.index(file.kind))


def run_files(options: Options, folder: Path, say: Console) -> Iterator[Outcome]:
    """Make each file, run the commands on it, and remove it."""
    goods = Goods(folder)
    files = list(choose_files(options))
    for place, file in enumerate(files, 1):
        say.print(f"{place} of {len(files)}: {file.kind}, {file.family}", end="\r", soft_wrap=True)
        good = goods.of(file.kind)
        random = generator(options.seed, file.kind, file.family, file.number)
        workplace = folder / "now"
        workplace.mkdir()
        path = workplace / f"bad{SUFFIXES[file.kind]}"
        file.make(good, path, random)
        for name, run in commands(file.kind, path, workplace, goods).items():
            yield Outcome(file, name, measure(run))
        shutil.rmtree(workplace)


def counts(outcomes: Iterable[Outcome]) -> Iterator[str]:
    """Yield a line for each kind of file and command: how many runs, and how they ended."""
    groups: dict[tuple[str, str], list[Outcome]] = {}
    for outcome in outcomes:
        groups.setdefault((outcome.file.kind, outcome.command), []).append(outcome)
    for (kind, command), group in groups.items():
        states = Counter(one.found.state for one in group)
        ended = ", ".join(f"{number} {state}" for state, number in states.most_common())
        memory = max(one.found.megabytes for one in group)
        seconds = max(one.found.seconds for one in group)
        yield f"{kind}, {command}: {ended}; at most {memory:.0f} MB, {seconds:.1f} s"


def main() -> int:
    """Run from the command line."""
    options = tyro.cli(Options, description=__doc__)
    say = Console(stderr=True)
    outcomes = []
    with tempfile.TemporaryDirectory() as name:
        for outcome in run_files(options, Path(name), say):
            outcomes.append(outcome)
            if not outcome.is_right:
                say.print(outcome.summary, markup=False, highlight=False, soft_wrap=True)
    print("\n".join(counts(outcomes)))
    wrong = sum(not outcome.is_right for outcome in outcomes)
    files = len({outcome.file for outcome in outcomes})
    print(f"{files:,} files, {len(outcomes):,} runs, {wrong:,} wrong")
    return min(wrong, 1)


if __name__ == "__main__":
    sys.exit(main())
