"""Results for readers: a markdown table."""

from collections.abc import Sequence
from typing import Any, Final

from sain_model.evaluation.markdown import markdown_table

HEADER: Final = (
    "scenario",
    "controller",
    "within",
    "solved",
    "95 % interval",
    "pushes",
    "prediction error",
    "planning",
)


def results_table(summary: Sequence[dict[str, Any]]) -> str:
    """Return the summary as a markdown table, a line for each row of `results.summarise`."""
    return markdown_table(HEADER, map(table_cells, summary))


def table_cells(row: dict[str, Any]) -> list[str]:
    """Return the cells of one row of the summary, as `HEADER` names them."""
    rate, pushes = row["rate"], row["pushes"]["estimate"]
    return [
        row["scenario"],
        row["controller"],
        f"{100 * row['tolerance']:g} cm",
        f"{row['successes']}/{row['scenes']}",
        f"{100 * rate['low']:.0f}-{100 * rate['high']:.0f} %",
        "-" if pushes is None else f"{pushes:.1f}",
        _scaled(row["target_error"], 1e3, "mm"),
        _scaled(row["planning_seconds"], 1e3, "ms", digits=0),
    ]


def _scaled(value: float | None, factor: float, unit: str, digits: int = 1) -> str:
    if value is None or value == 0.0:
        return "-"
    return f"{factor * value:.{digits}f} {unit}"
