"""Figures beside their targets, as a table on the screen and as JSON on request."""

import os
import platform
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TypeVar

import tyro
from rich.console import Console
from rich.table import Table

from sain_core.errors import OutputError
from sain_core.output import claim_file, write_json


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


@dataclass(frozen=True)
class ReportOptions:
    """Where the figures of a benchmark go."""

    out: Path | None = None
    """Write the figures to this JSON file."""
    overwrite: bool = False
    """Replace what others wrote there."""


Options = TypeVar("Options", bound=ReportOptions)


def read_options(kind: type[Options], description: str | None) -> Options:
    """Return the options of the command line; end where the figures cannot be written."""
    options = tyro.cli(kind, description=description)
    try:
        if options.out is not None:
            claim_file(options.out, options.overwrite)
    except OutputError as error:
        sys.exit(str(error))
    return options


def report(title: str, figures: list[Figure], out: Path | None = None) -> None:
    """Print figures and the load as a table, and write them to a JSON file when one is named."""
    figures = [*figures, Figure("load average", os.getloadavg()[0], "")]
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


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table: the first column to the left, the others to the right."""
    lines = [header, ["---", *["---:"] * (len(header) - 1)], *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
