"""Prediction errors as a table for the terminal."""

from typing import Any

from rich.table import Table

PARTS = {"all": "all pushes", "target_moved": "pushes that moved the target"}


def error_table(errors: dict[str, Any], part: str) -> Table:
    """Return one part of what `sain_model.evaluation.evaluate` returns as a table."""
    table = Table(title=f"Error after one push in mm, {PARTS[part]}", title_justify="left")
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


def history_table(errors: dict[str, Any]) -> Table:
    """Return the mean target errors by the number of earlier pushes, and the shares removed."""
    table = Table(
        title="Target error \\[mm] by earlier pushes (share of the reducible error removed)",
        title_justify="left",
    )
    table.add_column("prediction")
    groups = errors["by_history"]
    for group in groups:
        table.add_column(f"{group['earlier']} ({group['pushes']})", justify="right")
    for name in groups[0]["target_mean"]:
        table.add_row(name, *(_history_cell(group, name) for group in groups))
    return table


def _history_cell(group: dict[str, Any], name: str) -> str:
    mean = group["target_mean"].get(name)
    share = group.get("removed", {}).get(name)
    if mean is None:
        return ""
    return f"{mean:.3f}" if share is None else f"{mean:.3f} ({100 * share:.0f} %)"
