"""The gates that a change must pass, on small numbers.

Each figure is compared with what is allowed, and with the same figure of a baseline. *ok*: what is
allowed is reached, or there is only a baseline, and it is no worse. *open*: not reached, but no
worse than the baseline. *worse*: than the baseline, beyond its interval or the noise of a time.

`one_push` collects its sample below `--data` on first use; `speed` needs an idle machine; `graph`,
played only if named, starts the whole graph. All but `graph` take about eight minutes on two idle
cores. ``--out benchmarks/gates/baseline.json`` makes these figures the baseline.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import Final, Literal

import tyro

from benchmarks.gates.table import Baseline, Gate, print_gates, write_gates
from sain_core.output import claim_file

Name = Literal["speed", "one_push", "loops", "graph"]
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
        gates = measurement(name, options)()
        title = f"{name}, {perf_counter() - start:.0f} s"
        sound = print_gates(title, gates, Baseline.read(options.baseline, name)) and sound
        write_gates(options.out, name, gates)
    sys.exit(0 if sound else 1)


def measurement(name: Name, options: Options) -> Callable[[], list[Gate]]:
    """Return what measures a group; others need not be loaded."""
    if name == "one_push":
        return partial(_of("loops", "measure_one_push"), options.data)
    if name == "graph":
        return _of("speed", "measure_graph")
    return _of(name, "measure")


def _of(module: str, function: str) -> Callable[..., list[Gate]]:
    measure: Callable[..., list[Gate]] = getattr(
        import_module(f"benchmarks.gates.{module}"), function
    )
    return measure


if __name__ == "__main__":
    main()
