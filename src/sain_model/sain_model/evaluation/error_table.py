"""Prediction errors as a table for the terminal."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from sain_core.cli.terminal import FittingTable

PARTS = {"all": "all pushes", "target_moved": "pushes that moved the target"}


def make_table(title: str, header: Sequence[str], rows: Iterable[Sequence[str]]) -> FittingTable:
    """Return a table: the first column to the left, the others to the right."""
    table = FittingTable(title)
    for place, name in enumerate(header):
        table.add_column(name, justify="right" if place else "left")
    for row in rows:
        table.add_row(*row)
    return table


def error_tables(errors: dict[str, Any]) -> Iterator[FittingTable]:
    """Yield what `prediction_errors.evaluate` or `shape_errors.shape_errors` returns as tables."""
    if "bodies" in errors:
        yield _shape_table("Errors after one push", errors["bodies"])
        yield _shape_table("Errors of pushed bodies by shape", errors["shapes"])
        return
    yield from (_error_table(errors, part) for part in PARTS)
    yield _history_table(errors["by_history"])
    yield from map(_interval_table, errors["intervals"].values())


def _error_table(errors: dict[str, Any], part: str) -> FittingTable:
    header = ("prediction", "pushes", "target", "95 %", "median", "p95", "mid disk")
    rows = (
        (
            name,
            str(row["pushes"]),
            f"{row['target_mean']:.2f}",
            f"{row['target_low']:.2f}-{row['target_high']:.2f}",
            f"{row['target_median']:.2f}",
            f"{row['target_p95']:.2f}",
            f"{row['mid_mean']:.2f}",
        )
        for name, row in errors[part].items()
    )
    return make_table(f"Error after one push in mm, {PARTS[part]}", header, rows)


def _shape_table(title: str, groups: dict[str, dict[str, Any]]) -> FittingTable:
    """Return what `shape_errors.figures` found of groups of bodies."""
    header = ["bodies", "number"]
    header += [f"{name} {unit}" for unit in ("mm", "deg") for name in ("prior", "SAIN", "ratio")]
    rows = []
    for name, row in groups.items():
        cells = [name, str(row["pushes"])]
        for unit in ("mm", "deg"):
            ratio, low, high = row[f"ratio_{unit}"]
            cells += [f"{row[f'{model}_{unit}']:.2f}" for model in ("prior", "sain")]
            cells.append(f"{ratio:.2f} {low:.2f}-{high:.2f}")
        cells.append(f"{100 * row['coverage']:.0f}" if "coverage" in row else "")
        rows.append(cells)
    return make_table(title, [*header, "coverage %"], rows)


def _history_table(groups: list[dict[str, Any]]) -> FittingTable:
    """Return the mean target errors by the number of earlier pushes, and the shares removed."""
    title = "Target error [mm] by earlier pushes, share of the reducible error removed"
    header = ["prediction", *(f"{group['earlier']} ({group['pushes']})" for group in groups)]
    rows = (
        (name, *(_history_cell(group, name) for group in groups))
        for name in groups[0]["target_mean"]
    )
    return make_table(title, header, rows)


def _interval_table(intervals: dict[str, Any]) -> FittingTable:
    """Return what `coverage.measure_intervals` found of the target as a table."""
    ranks = intervals["target"]["rank_correlation"]
    told = ", ".join(f"{name} {rank:.2f}" for name, rank in ranks.items() if rank is not None)
    title = (
        f"{100 * intervals['level']:.0f} % regions of the target; {intervals['members']}"
        f" members; rank correlation with the error: {told}"
    )
    header = ("pushes", "number", "held [%]", "95 %", "error [mm]", "spread", "radius")
    rows = (
        (
            name,
            str(part["pushes"]),
            f"{100 * part['coverage']:.1f}",
            f"{100 * part['coverage_low']:.0f}-{100 * part['coverage_high']:.0f}",
            f"{part['error_mean']:.3f}",
            f"{part['spread_mean']:.3f}",
            f"{part['radius_median']:.3f}",
        )
        for name, part in intervals["target"]["parts"].items()
    )
    return make_table(title, header, rows)


def _history_cell(group: dict[str, Any], name: str) -> str:
    mean = group["target_mean"].get(name)
    share = group.get("removed", {}).get(name)
    if mean is None:
        return ""
    return f"{mean:.2f}" if share is None or share < 0.0 else f"{mean:.2f} {100 * share:3.0f} %"


def gain_line(gain: dict[str, Any], parent: str, part: str) -> str:
    """Return in words what `fine_tuning.Parent.gain` found, on this part of the data."""
    ratio, low, high = gain["ratio"]
    return (
        f"{gain['bodies']}: mean error on the {part} episodes {gain['before']:.2f} mm"
        f" with {parent}, {gain['after']:.2f} mm now; ratio {ratio:.2f} \\[{low:.2f}, {high:.2f}]"
    )
