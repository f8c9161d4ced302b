"""What became of faults, as a table in the terminal and as a page."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Final

import numpy as np
from rich.console import Console

from sain_core.cli.terminal import FittingTable
from sain_core.output import write_whole
from sain_core.provenance import git_commit, processor

HEAD: Final = ("Fault", "Tries", "Survived", "Lost", "Recovery: longest", "99 %")
ABOUT: Final = """# Faults

For users who rely on the graph. The faults below were made while it played `anywhere` episodes;
those at the end while a UR5 on the bench brought a T to goals. `make faults` measures them and
writes this page.

* **Survived**: the episode continued to its end.
* **Lost**: pushes that were executed twice, pushes that did not begin where the last one ended,
  and results that are not in the bag. With the arm: pushes that count and were not made, or were
  made and do not count; limits that were broken; motion without the enable signal. Results are not
  counted from 1 s before the recorder was killed or stopped until it records again.
* **Recovery**: time from the fault until a push was executed with all processes running again.

With the arm, a fault lasts 5 s. A kind has variants, which take turns: a value that is NaN, a stamp
of an hour ago, another frame, and more (`SPOILT` in `benchmarks/faults/arm_faults.py`).
"""


@dataclass(frozen=True)
class Row:
    """One kind of fault."""

    fault: str
    tries: int
    survived: int
    lost: int
    recoveries: Sequence[float] = ()  # [s]
    note: str = ""

    @property
    def cells(self) -> tuple[str, ...]:
        """The row as texts."""
        known = [one for one in self.recoveries if isfinite(one)]
        longest = f"{max(known):.1f} s" if known else ""
        quantile = f"{np.quantile(known, 0.99):.1f} s" if known else ""
        counts = (f"{self.tries:,}", f"{self.survived:,}", f"{self.lost:,}")
        return (self.fault, *counts, longest, quantile)

    @property
    def is_well(self) -> bool:
        """Whether nothing was lost."""
        return self.survived == self.tries and not self.lost


def show(rows: Sequence[Row], console: Console) -> None:
    """Print the table."""
    table = FittingTable(HEAD)
    for row in rows:
        table.add_row(*row.cells)
    console.print(table, soft_wrap=True)
    for row in rows:
        if row.note:
            console.print(f"{row.fault}: {row.note}", markup=False, soft_wrap=True)


def write_page(path: Path, rows: Sequence[Row], command: str) -> None:
    """Write the table as a page."""
    lines = ["| " + " | ".join(HEAD) + " |", "| --- |" + " ---: |" * (len(HEAD) - 1)]
    lines += ["| " + " | ".join(row.cells) + " |" for row in rows]
    notes = [f"* **{row.fault}**: {row.note}" for row in rows if row.note]
    made = f"`{command}`, commit {git_commit()[:9]}, on {processor()}."
    text = "\n".join([ABOUT, *lines, "", *notes, *([""] if notes else []), made])
    write_whole(path, (text + "\n").encode())
