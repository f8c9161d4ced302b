"""What became of faults, as a table in the terminal and as a page."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Final

import numpy as np
from rich.console import Console

from sain_core.cli.terminal import FittingTable
from sain_core.provenance import git_commit, processor
from sain_core.storage import write_whole

HEAD: Final = ("Fault", "Tries", "Survived", "Lost", "Recovery: longest", "99 %")
ABOUT: Final = """# Faults

What was done to a graph that played `anywhere` episodes, below its nodes, and the result. This page
is written by `make faults`.

* **Survived**: the episode continued to its end.
* **Lost**: pushes executed twice, pushes that did not begin where the one before had led, and
  results that are not in the bag. Without those from 1 s before the recorder was struck until it
  was back.
* **Recovery**: from the fault until a push was executed with all processes there again.
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
    table = FittingTable()
    for name in HEAD:
        table.add_column(name, "left" if name == HEAD[0] else "right")
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
