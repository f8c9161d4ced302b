"""Figures beside their targets, as a table on the screen and as JSON on request."""

import os
import platform
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table

from sain_core.output import write_json


@dataclass(frozen=True)
class Figure:
    """One measured number, and what it should be."""

    name: str
    value: float
    unit: str
    at_most: float | None = None
    at_least: float | None = None

    @property
    def target(self) -> str:
        """The target in words; empty when there is none."""
        if self.at_most is not None:
            return f"<= {self.at_most:g}"
        return f">= {self.at_least:g}" if self.at_least is not None else ""

    @property
    def met(self) -> bool | None:
        """Whether the target is met; None when there is none."""
        if self.at_most is not None:
            return bool(self.value <= self.at_most)
        return bool(self.value >= self.at_least) if self.at_least is not None else None


def report(title: str, figures: list[Figure], out: Path | None = None) -> None:
    """Print figures as a table, and write them to a JSON file when one is named."""
    table = Table(title=title, title_justify="left")
    for column, justify in (("figure", "left"), ("value", "right"), ("target", "right")):
        table.add_column(column, justify=justify)  # type: ignore[arg-type]
    table.add_column("")
    for figure in figures:
        mark = {True: "[green]met[/]", False: "[red]missed[/]", None: ""}[figure.met]
        table.add_row(figure.name, f"{figure.value:.3g} {figure.unit}", figure.target, mark)
    Console().print(table)
    if out is not None:
        content = {
            "title": title,
            "command": sys.argv,
            "machine": {"cpus": os.cpu_count(), "processor": platform.processor()},
            "figures": [
                asdict(figure) | {"value": float(figure.value), "met": figure.met}
                for figure in figures
            ],
        }
        write_json(out, content)
