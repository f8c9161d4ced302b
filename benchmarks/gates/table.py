"""Gates: a measured figure, what is allowed, and the same figure of a baseline."""

import json
import os
import shlex
import sys
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Self

from rich.console import Console
from rich.table import Table

from sain_core.output import write_json
from sain_core.provenance import DISTRIBUTION, git_commit, processor, versions

PACKAGES: Final = ("numpy", "numba", "torch", "pybullet", "mujoco", DISTRIBUTION)
OK, OPEN, WORSE = "ok", "open", "worse"
WIDTH: Final = 120  # of tables in a file


@dataclass(frozen=True)
class Gate:
    """One figure.

    Attributes:
        name: of the figure; a baseline is compared by it.
        value: as measured.
        unit: of the value.
        at_most: what is allowed; None: only the baseline counts.
        at_least: likewise.
        interval: 95 % of the value; None: it has no spread.
        slack: the share of a baseline without interval by which the value may be worse.
        shown: the value in words; empty: as a number.
        more_is_better: else less is.
    """

    name: str
    value: float
    unit: str = ""
    at_most: float | None = None
    at_least: float | None = None
    interval: tuple[float, float] | None = None
    slack: float = 0.0
    shown: str = ""
    more_is_better: bool = False

    @property
    def met(self) -> bool | None:
        """Whether what is allowed is reached; None: nothing is said."""
        if self.at_most is not None:
            return self.value <= self.at_most
        return None if self.at_least is None else self.value >= self.at_least

    @property
    def allowed(self) -> str:
        """What is allowed, in words."""
        if self.at_most is not None:
            return f"<= {self.at_most:,g}"
        return "" if self.at_least is None else f">= {self.at_least:,g}"

    @property
    def text(self) -> str:
        """The value in words."""
        number = f"{self.value:,.0f}" if abs(self.value) >= 1000 else f"{self.value:.3g}"
        return self.shown or f"{number} {self.unit}".strip()

    @property
    def worst(self) -> float:
        """The worst value that is no worse than this one."""
        if self.interval is not None:
            return self.interval[0 if self.more_is_better else 1]
        return self.value * (1.0 - self.slack if self.more_is_better else 1.0 + self.slack)

    def verdict(self, baseline: "Gate | None") -> str:
        """Return `OK`; `WORSE` than the baseline; or `OPEN`: not reached, and no worse."""
        if self.met:
            return OK
        if baseline is not None and self._beyond(baseline.worst):
            return WORSE
        if self.met is None:
            return "" if baseline is None else OK
        return OPEN

    def _beyond(self, worst: float) -> bool:
        return self.value < worst if self.more_is_better else self.value > worst


def print_gates(title: str, gates: Iterable[Gate], baseline: "Baseline") -> bool:
    """Print the gates of a group; tell whether none is worse than in the baseline."""
    table = Table(title=title, title_justify="left")
    for column in ("gate", "allowed", f"baseline {baseline.commit}", "measured"):
        table.add_column(column, justify="left" if column == "gate" else "right")
    table.add_column("")
    colours = {OK: "green", OPEN: "yellow", WORSE: "red", "": "default"}
    sound = True
    for gate in gates:
        kept = baseline.gates.get(gate.name)
        verdict = gate.verdict(kept)
        sound = sound and verdict != WORSE
        cells = gate.name, gate.allowed, kept.text if kept else "", gate.text
        table.add_row(*cells, f"[{colours[verdict]}]{verdict}[/]")
    Console(width=None if sys.stdout.isatty() else WIDTH).print(table)
    return sound


@dataclass(frozen=True)
class Baseline:
    """The gates of a group as they were at a commit."""

    commit: str
    gates: dict[str, Gate]

    @classmethod
    def read(cls, path: Path, group: str) -> Self:
        """Read a file of `write_gates`; without the group there are none."""
        part = _read(path).get(group, {"made": {"commit": ""}, "gates": []})
        gates = {row["name"]: Gate(**row) for row in part["gates"]}
        return cls(part["made"]["commit"][:8], gates)


def write_gates(path: Path, group: str, gates: Iterable[Gate]) -> None:
    """Write the gates of a group with how they were made; other groups of the file stay."""
    made = {
        "commit": git_commit(),
        "command": shlex.join(["python", "-m", "benchmarks.gates", *sys.argv[1:]]),
        "versions": versions(*PACKAGES),
        "processor": processor(),
        "load": round(os.getloadavg()[0], 1),
    }
    rows = [_stated(gate) for gate in gates]
    write_json(path, {**_read(path), group: {"made": made, "gates": rows}})


def _read(path: Path) -> dict[str, Any]:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def _stated(gate: Gate) -> dict[str, Any]:
    """Return the fields of a gate that are not the usual ones."""
    return {k: v for k, v in asdict(gate).items() if v != getattr(Gate, k, ...)}
