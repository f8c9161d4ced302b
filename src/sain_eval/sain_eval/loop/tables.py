"""The tables of an evaluation: its summary, each shape, and the episodes that failed."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any, Final

from rich.console import Console

from sain_core.cli.terminal import FittingTable, markdown_table
from sain_core.output import write_whole
from sain_core.shapes.solids import DISK
from sain_eval.loop.closed_loop import BASELINES
from sain_eval.loop.results import SceneRecord, summarise

HEADER: Final = (
    "scenario", "controller", "within", "solved", "95 % interval", "pushes", "prediction error",
    "refused", "planning median / p95",
)  # fmt: skip
TABLE_FILE: Final = "table.md"
SHAPE_TABLE_FILE: Final = "table_per_shape.md"
FAILURES_FILE: Final = "failures.md"
TABLES: Final = (TABLE_FILE, SHAPE_TABLE_FILE, FAILURES_FILE)
MOST_FAILURES: Final = 40  # that are printed
SHAPES_SCENARIO: Final = "shapes"  # has another shape for each seed


def results_table(summary: Iterable[dict[str, Any]], header: Sequence[str] = HEADER) -> str:
    """Return the summary as a markdown table, a line for each row of `summarise`."""
    return markdown_table(header, map(table_cells, summary))


def table_cells(row: dict[str, Any]) -> list[str]:
    """Return the cells of one row of the summary, as `HEADER` names them."""
    rate, pushes, error, turn = (row[k] for k in ("rate", "pushes", "target_error", "turn_error"))
    median, p95 = row["planning_median"], row["planning_p95"]
    turned = "" if turn is None else f", {turn:.3f} rad"
    return [
        row["scenario"],
        row["controller"],
        within_text(row),
        solved_text(row),
        f"{100 * rate['low']:.0f}-{100 * rate['high']:.0f} %",
        "-" if pushes["estimate"] is None else f"{pushes['estimate']:.1f}",
        "-" if error is None else f"{1e3 * error:.1f} mm{turned}",
        str(row["refusals"]),
        "-" if median is None else f"{1e3 * median:.0f} / {1e3 * p95:.0f} ms",
    ]


def within_text(row: dict[str, Any]) -> str:
    """Return what counts as success in a row of the summary: its tolerance, if nothing else."""
    return row.get("within") or tolerance_text(row["tolerance"], row["heading_tolerance"])


def tolerance_text(distance: float, turn: float) -> str:
    """Return a tolerance [m, rad] in words; a turn of 0: the goal is a place."""
    text = f"{100 * distance:g} cm"
    return f"{text}, {turn:g} rad" if turn else text


def solved_text(row: dict[str, Any]) -> str:
    """Return how many scenes were solved; where these have several goals, how many in a row."""
    tipped = f", {row['tipped']} tipped" if row.get("tipped") else ""
    text = f"{row['successes']}/{row['scenes']}{tipped}"
    if row["most_goals"] == 1:
        return text
    in_a_row = ", ".join(map(str, row["goals_in_a_row"]))
    return f"{text}; {in_a_row} of {row['most_goals']} goals in a row"


def shape_table(records: Iterable[SceneRecord]) -> str:
    """Return a markdown table with a line for each shape; empty without `SHAPES_SCENARIO`."""
    shown = [record for record in records if record.scenario == SHAPES_SCENARIO and record.shapes]
    if not shown:
        return ""
    by_shape = [replace(record, scenario=", ".join(record.shapes)) for record in shown]
    order = {record.scenario: record.seed for record in reversed(by_shape)}
    rows = sorted(summarise(by_shape), key=lambda row: order[row["scenario"]])
    return results_table(rows, ("shape", *HEADER[1:]))


def failures(records: Iterable[SceneRecord]) -> list[SceneRecord]:
    """Return the record of each episode that failed, at the widest tolerance that it missed.

    Those of controllers that plan come before those of baselines.
    """
    widest: dict[tuple[str, int, str], SceneRecord] = {}
    for record in records:
        if not record.success:
            other = widest.setdefault(record.episode, record)
            widest[record.episode] = max(other, record, key=lambda one: one.tolerance)

    def order(record: SceneRecord) -> tuple[bool, int, str, str, int]:
        plain = record.controller in BASELINES
        return plain, record.place, record.scenario, record.controller, record.seed

    return sorted(widest.values(), key=order)


def failures_page(records: Sequence[SceneRecord]) -> str:
    """Return a page with a line for each episode that failed, by scenario and controller."""
    episodes = Counter((scenario, name) for scenario, _, name in {r.episode for r in records})
    parts = []
    grouped = groupby(failures(records), key=lambda record: (record.scenario, record.controller))
    for key, group in grouped:
        lines = [f"* {failure_line(record)}\n" for record in group]
        parts.append(f"## {', '.join(key)}: {len(lines)} of {episodes[key]}\n\n{''.join(lines)}")
    return "\n".join(parts) or "None.\n"


def failure_line(record: SceneRecord) -> str:
    """Return which episode failed, at which tolerance, why, and how it ended."""
    bodies = f" ({', '.join(record.shapes)})" if {*record.shapes} - {DISK} else ""
    turn = record.has_heading * record.heading_tolerance
    within = record.within or tolerance_text(record.tolerance, turn)
    end = f"{1e3 * record.final_distance:.1f} mm"
    end += f", {record.final_turn:.3f} rad" if record.has_heading else ""
    several = record.most_goals > 1 or record.goals > 1
    goals = f" after {record.goals} goals in a row" if several else ""
    return (
        f"{record.scenario} {record.seed}{bodies}, {record.controller}, not within {within}"
        f"{goals}: {record.failure}; {record.pushes} pushes, {record.refusals} refused, ended"
        f" {end} away"
    )


def write_tables(folder: Path, records: Sequence[SceneRecord]) -> None:
    """Write the table, that of each shape, and the page of failures."""
    write_whole(folder / TABLE_FILE, results_table(summarise(records)).encode())
    if per_shape := shape_table(records):
        write_whole(folder / SHAPE_TABLE_FILE, per_shape.encode())
    write_whole(folder / FAILURES_FILE, failures_page(records).encode())


def show_summary(summary: list[dict[str, Any]], console: Console) -> None:
    """Print the summary as a table."""
    table = FittingTable(HEADER, left=HEADER)
    for row in summary:
        table.add_row(*table_cells(row))
    console.print(table, soft_wrap=True)


def show_failures(records: Sequence[SceneRecord], path: Path, console: Console) -> None:
    """Print each failed episode with its reason; where there are many, the first ones."""
    lines = [failure_line(record) for record in failures(records)]
    if lines:
        console.print(f"\nFailures ({len(lines)}):", highlight=False)
    for line in lines[:MOST_FAILURES]:
        console.print(f"  {line}", markup=False, highlight=False, emoji=False, soft_wrap=True)
    if len(lines) > MOST_FAILURES:
        console.print(f"  and {len(lines) - MOST_FAILURES} more in {path}", markup=False)
