"""The gates that a change must pass, on small numbers.

Each figure is compared with what is allowed, and with the same figure of a baseline. *ok*: what is
allowed is reached, or there is only a baseline, and it is no worse. *open*: not reached, but no
worse than the baseline. *worse*: than the baseline, beyond its interval or the noise of a time.

`one_push` collects its sample below `--data` on first use; `speed` needs an idle machine. All take
about eight minutes on two idle cores. ``--out benchmarks/gates/baseline.json`` makes these figures
the baseline.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Final, Literal

import tyro

from benchmarks.gates import loops, speed
from benchmarks.gates.table import Baseline, Gate, print_gates, write_gates
from sain_core.output import claim_file

Name = Literal["speed", "one_push", "loops"]
BASELINE: Final = Path(__file__).with_name("baseline.json")


@dataclass(frozen=True)
class Options:
    """What to measure, and what to compare with."""

    only: tuple[Name, ...] = ("speed", "one_push", "loops")
    """what to measure"""
    baseline: Path = BASELINE
    """figures to compare with, written by --out"""
    data: Path = Path("data/gates")
    """where the sample of single pushes is, or will be"""
    out: Path = Path("results/gates.json")
    """write the figures to this JSON file; groups that are not measured stay in it"""
    overwrite: bool = False
    """replace a file that others wrote"""


def main() -> None:
    """Measure, print a table for each group, and exit with 1 if anything is worse."""
    options = tyro.cli(Options, description=__doc__)
    if options.baseline not in (BASELINE, options.out) and not options.baseline.exists():
        sys.exit(f"there is no baseline {options.baseline}; make one: --out {options.baseline}")
    claim_file(options.out, options.overwrite)
    sound = True
    for name in options.only:
        start = perf_counter()
        gates = measure(name, options)
        title = f"{name}, {perf_counter() - start:.0f} s"
        sound = print_gates(title, gates, Baseline.read(options.baseline, name)) and sound
        write_gates(options.out, name, gates)
    sys.exit(0 if sound else 1)


def measure(name: Name, options: Options) -> list[Gate]:
    """Measure a group."""
    if name == "one_push":
        return loops.measure_one_push(options.data)
    return loops.measure() if name == "loops" else speed.measure()


if __name__ == "__main__":
    main()
