"""Results as tables for people."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any, Final

from sain_core.shapes.solids import DISK
from sain_eval.loop.controllers import BASELINES
from sain_eval.loop.results import SceneRecord, summarise
from sain_model.evaluation.markdown import markdown_table

HEADER: Final = (
    "scenario",
    "controller",
    "within",
    "solved",
    "95 % interval",
    "pushes",
    "prediction error",
    "refused",
    "planning median / p95",
)
SHAPES_SCENARIO: Final = "shapes"  # has another shape for each seed


def results_table(summary: Sequence[dict[str, Any]]) -> str:
    """Return the summary as a markdown table, a line for each row of `summarise`."""
    return markdown_table(HEADER, map(table_cells, summary))


def table_cells(row: dict[str, Any]) -> list[str]:
    """Return the cells of one row of the summary, as `HEADER` names them."""
    rate, pushes = row["rate"], row["pushes"]["estimate"]
    return [
        row["scenario"],
        row["controller"],
        tolerance_text(row["tolerance"], row["heading_tolerance"]),
        solved_text(row),
        f"{100 * rate['low']:.0f}-{100 * rate['high']:.0f} %",
        "-" if pushes is None else f"{pushes:.1f}",
        _error_text(row),
        str(row["refusals"]),
        _planning_text(row),
    ]


def shape_table(records: Iterable[SceneRecord]) -> str:
    """Return a markdown table with a line for each shape; empty without `SHAPES_SCENARIO`."""
    shown = [record for record in records if record.scenario == SHAPES_SCENARIO and record.shapes]
    if not shown:
        return ""
    by_shape = [replace(record, scenario=", ".join(record.shapes)) for record in shown]
    order = {record.scenario: record.seed for record in reversed(by_shape)}
    rows = sorted(summarise(by_shape), key=lambda row: order[row["scenario"]])
    return markdown_table(("shape", *HEADER[1:]), map(table_cells, rows))


def failures(records: Iterable[SceneRecord]) -> list[SceneRecord]:
    """Return the record of each episode that failed, at the widest tolerance that it missed.

    Those of controllers that plan come before those of baselines.
    """
    widest: dict[tuple[str, int, str], SceneRecord] = {}
    for record in records:
        key = _name(record)
        if not record.success and (key not in widest or record.tolerance > widest[key].tolerance):
            widest[key] = record

    def order(record: SceneRecord) -> tuple[bool, int, str, str, int]:
        plain = record.controller in BASELINES
        return plain, record.place, record.scenario, record.controller, record.seed

    return sorted(widest.values(), key=order)


def failures_page(records: Sequence[SceneRecord]) -> str:
    """Return a page with a line for each episode that failed, by scenario and controller."""
    episodes = Counter((scenario, name) for scenario, _, name in {_name(r) for r in records})
    parts = []
    grouped = groupby(failures(records), key=lambda record: (record.scenario, record.controller))
    for key, group in grouped:
        lines = [f"* {failure_line(record)}\n" for record in group]
        parts.append(f"## {', '.join(key)}: {len(lines)} of {episodes[key]}\n\n{''.join(lines)}")
    return "\n".join(parts) or "None.\n"


def _name(record: SceneRecord) -> tuple[str, int, str]:
    """Return what no two episodes of an evaluation share."""
    return record.scenario, record.seed, record.controller


def failure_line(record: SceneRecord) -> str:
    """Return which episode failed, at which tolerance, why, and how it ended."""
    bodies = f" ({', '.join(record.shapes)})" if {*record.shapes} - {DISK} else ""
    within = tolerance_text(record.tolerance, record.has_heading * record.heading_tolerance)
    end = f"{1e3 * record.final_distance:.1f} mm"
    end += f", {record.final_turn:.3f} rad" if record.has_heading else ""
    several = record.most_goals > 1 or record.goals > 1
    goals = f" after {record.goals} goals in a row" if several else ""
    return (
        f"{record.scenario} {record.seed}{bodies}, {record.controller}, not within {within}"
        f"{goals}: {record.failure}; {record.pushes} pushes, {record.refusals} refused, ended"
        f" {end} away"
    )


def tolerance_text(distance: float, turn: float) -> str:
    """Return a tolerance [m, rad] in words; a turn of 0: the goal is a place."""
    text = f"{100 * distance:g} cm"
    return f"{text}, {turn:g} rad" if turn else text


def solved_text(row: dict[str, Any]) -> str:
    """Return how many scenes were solved; where these have several goals, how many in a row."""
    text = f"{row['successes']}/{row['scenes']}"
    if row["most_goals"] == 1:
        return text
    in_a_row = ", ".join(map(str, row["goals_in_a_row"]))
    return f"{text}; {in_a_row} of {row['most_goals']} goals in a row"


def _error_text(row: dict[str, Any]) -> str:
    text = _scaled(row["target_error"], 1e3, "mm")
    turn = row["turn_error"]
    return text if turn is None else f"{text}, {turn:.3f} rad"


def _planning_text(row: dict[str, Any]) -> str:
    if row["planning_median"] is None:  # a baseline, or results of an earlier version
        return _scaled(row["planning_seconds"], 1e3, "ms", digits=0)
    return f"{1e3 * row['planning_median']:.0f} / {1e3 * row['planning_p95']:.0f} ms"


def _scaled(value: float | None, factor: float, unit: str, digits: int = 1) -> str:
    if value is None or value == 0.0:
        return "-"
    return f"{factor * value:.{digits}f} {unit}"
