"""Does a flipped bit ever make a wrong row? ``./env python -m benchmarks.flipped_bits``.

A bag of pushes is copied with one random bit flipped in its MCAP file, and converted. Right is an
error that names the damage, or the very rows of the whole bag, where no row is made of that bit.
Silently wrong is everything else; an exception that is no `DatasetError` ends the benchmark.
"""

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import tyro
from numpy import ndarray

from benchmarks.made_bags import MadeBag
from benchmarks.report import Figure, report
from sain_bags.dataset.conversion import convert
from sain_core.dataset import SHARD_PATTERN
from sain_core.errors import DatasetError
from sain_core.seeding import generator
from sain_core.storage import read_arrays

OF_THE_FILE = "bag_sha256"  # a flipped bit changes it, as it should


@dataclass(frozen=True)
class Options:
    """How often to flip, and in what."""

    bag: Path | None = None
    """a bag of one file; none: one is made"""
    pushes: int = 100
    """in the bag that is made"""
    count: int = 1000
    """of flips"""
    seed: int = 0
    """of where they are"""
    out: Path | None = None
    """a JSON file for the figures"""


def rows_of(folder: Path) -> list[dict[str, ndarray]]:
    """Return the shards of a data set, but what is of the file."""
    shards = [read_arrays(path) for path in sorted(folder.glob(SHARD_PATTERN))]
    return [{key: shard[key] for key in shard if key != OF_THE_FILE} for shard in shards]


def same(one: list[dict[str, ndarray]], other: list[dict[str, ndarray]]) -> bool:
    """Tell whether two data sets are the same, byte for byte."""
    return len(one) == len(other) and all(
        first.keys() == second.keys()
        and all(first[key].tobytes() == second[key].tobytes() for key in first)
        for first, second in zip(one, other, strict=True)
    )


def count_outcomes(bag: Path, options: Options, folder: Path) -> dict[str, int]:
    """Flip bits, one at a time; return how often which outcome came."""
    convert([bag], folder / "whole")
    wanted = rows_of(folder / "whole")
    copy = folder / "copy"
    shutil.copytree(bag, copy)
    (file,) = copy.glob("*.mcap")
    content = file.read_bytes()
    counts = {"error": 0, "same rows": 0, "silently wrong": 0}
    for place in generator(options.seed, 0).integers(8 * len(content), size=options.count):
        damaged = bytearray(content)
        damaged[place // 8] ^= 1 << (place % 8)
        file.write_bytes(damaged)
        try:
            convert([copy], folder / "out", overwrite=True)
        except DatasetError:
            counts["error"] += 1
            continue
        is_same = same(rows_of(folder / "out"), wanted)
        counts["same rows" if is_same else "silently wrong"] += 1
    return counts


def main() -> None:
    """Run from the command line."""
    options = tyro.cli(Options, description=__doc__)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bag = options.bag
        if bag is None:
            bag = folder / "bag"
            made = MadeBag(bag)
            made.pushes(options.pushes)
            made.writer.close()
        counts = count_outcomes(bag, options, folder)
        figures = [
            Figure(outcome, count, "flips", at_most=0 if outcome == "silently wrong" else None)
            for outcome, count in counts.items()
        ]
        report(f"{options.count:,} flipped bits", figures, options.out)


if __name__ == "__main__":
    main()
