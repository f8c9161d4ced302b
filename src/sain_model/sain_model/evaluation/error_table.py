"""Prediction errors as a table for the terminal."""

from typing import Any

from sain_core.cli.fitting_table import FittingTable

PARTS = {"all": "all pushes", "target_moved": "pushes that moved the target"}


def error_table(errors: dict[str, Any], part: str) -> FittingTable:
    """Return one part of what `prediction_errors.evaluate` returns as a table."""
    table = FittingTable(f"Error after one push in mm, {PARTS[part]}")
    table.add_column("prediction")
    for column in ("pushes", "target", "95 %", "median", "p95", "mid disk"):
        table.add_column(column, justify="right")
    for name, row in errors[part].items():
        table.add_row(
            name,
            str(row["pushes"]),
            f"{row['target_mean']:.2f}",
            f"{row['target_low']:.2f}-{row['target_high']:.2f}",
            f"{row['target_median']:.2f}",
            f"{row['target_p95']:.2f}",
            f"{row['mid_mean']:.2f}",
        )
    return table


def history_table(errors: dict[str, Any]) -> FittingTable:
    """Return the mean target errors by the number of earlier pushes, and the shares removed."""
    table = FittingTable(
        "Target error [mm] by earlier pushes, share of the reducible error removed"
    )
    table.add_column("prediction")
    groups = errors["by_history"]
    for group in groups:
        table.add_column(f"{group['earlier']} ({group['pushes']})", justify="right")
    for name in groups[0]["target_mean"]:
        table.add_row(name, *(_history_cell(group, name) for group in groups))
    return table


def gain_line(gain: dict[str, Any], parent: str, part: str) -> str:
    """Return in words what `fine_tuning.Parent.gain` found, on this part of the data."""
    ratio, low, high = gain["ratio"]
    return (
        f"target's mean error on the {part} episodes: {gain['before']:.2f} mm with {parent},"
        f" {gain['after']:.2f} mm now; ratio {ratio:.2f} \\[{low:.2f}, {high:.2f}]"
    )


def interval_table(intervals: dict[str, Any]) -> FittingTable:
    """Return what `coverage.measure_intervals` found of the target as a table."""
    ranks = intervals["target"]["rank_correlation"]
    told = ", ".join(f"{name} {rank:.2f}" for name, rank in ranks.items() if rank is not None)
    table = FittingTable(
        f"{100 * intervals['level']:.0f} % regions of the target; {intervals['members']}"
        f" members; rank correlation with the error: {told}"
    )
    table.add_column("pushes")
    for column in ("number", "held [%]", "95 %", "error [mm]", "spread", "radius"):
        table.add_column(column, justify="right")
    for name, part in intervals["target"]["parts"].items():
        table.add_row(
            name,
            str(part["pushes"]),
            f"{100 * part['coverage']:.1f}",
            f"{100 * part['coverage_low']:.0f}-{100 * part['coverage_high']:.0f}",
            f"{part['error_mean']:.3f}",
            f"{part['spread_mean']:.3f}",
            f"{part['radius_median']:.3f}",
        )
    return table


def _history_cell(group: dict[str, Any], name: str) -> str:
    mean = group["target_mean"].get(name)
    share = group.get("removed", {}).get(name)
    if mean is None:
        return ""
    return f"{mean:.2f}" if share is None or share < 0.0 else f"{mean:.2f} {100 * share:3.0f} %"
