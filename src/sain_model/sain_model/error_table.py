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
