"""Writes what open loops show: JSON, a table in Markdown, a picture."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from sain_core.model import Model
from sain_core.storage import write_whole
from sain_model.data.dataset import Dataset
from sain_model.dynamics.settings import STEPS
from sain_model.evaluation.baselines import refusals
from sain_model.evaluation.markdown import markdown_table
from sain_model.evaluation.metrics import FLOOR, LEARNED, NO_MOTION
from sain_model.evaluation.open_loop import TRUE_FRICTION, OpenLoop, predict_open_loop
from sain_model.evaluation.open_loop_errors import errors_after, ratios
from sain_model.evaluation.open_loop_plot import save_open_loop_plot

BELOW_ALL: Final = (FLOOR, TRUE_FRICTION, NO_MOTION)  # no physics that could be had
COLUMNS: Final = (
    "prediction",
    "windows",
    "target mean",
    "median",
    "p95",
    "mid mean",
    "median",
    "p95",
    "target heading",
    "mid heading",
    "contacts agreed",
)
STATISTICS: Final = ("{mean:.2f} [{low:.2f}, {high:.2f}]", "{median:.2f}", "{p95:.2f}")


def report_open_loop(
    out: Path,
    data: Dataset,
    models: Mapping[str, Model],
    seed: int,
    steps: tuple[int, ...] = STEPS,
    others: Mapping[str, Model] | None = None,
) -> dict[str, Any]:
    """Roll out everything over held-out pushes; write NAME_open_loop.md and .png beside `out`.

    Return what belongs into the JSON report `out`, which the caller writes.

    Args:
        out: path of the JSON report.
        data: pushes that no model was trained on.
        models: by name: `open_loop.RECURRENT_SAIN` and the like.
        seed: of the bootstrap.
        steps: after how many pushes errors are taken; those that no window reaches are left out.
        others: more physics by name.
    """
    loop = predict_open_loop(data, models, max(steps), others)
    report = {
        str(step): _errors(loop, [*models], step, seed)
        for step in steps
        if loop.windows.known[:, step - 1].any()
    }
    text = markdown(report) + "".join(
        f"* {name}: pushes that could not be carried out in the scenes that it predicted, and moved"
        f" nothing: {count}\n"
        for name, count in refusals(others or {}).items()
    )
    write_whole(out.with_name(f"{out.stem}_open_loop.md"), text.encode())
    save_open_loop_plot(out.with_name(f"{out.stem}_open_loop.png"), loop, seed)
    return report


def _errors(loop: OpenLoop, models: list[str], step: int, seed: int) -> dict[str, Any]:
    errors = errors_after(loop, step, seed)
    means = {name: row["target"]["mean"] for name, row in errors["all"].items()}
    learned = [name for name in means if name.startswith(tuple(models))]
    physics = [name for name in means if name not in (*learned, *BELOW_ALL)]
    best = min(physics, key=means.__getitem__)
    found = {"errors": errors, "best_physics": best}
    for below in [best] + [name for name in models if name == LEARNED]:
        every = ratios(loop, step, below, seed)
        found[f"ratio_to_{below}"] = {name: every[name] for name in learned if name in every}
    return found


def markdown(report: dict[str, Any]) -> str:
    """Return the tables of a report, positions in mm, headings in mrad (means)."""
    parts = []
    for step, found in report.items():
        pushes = "1 push" if step == "1" else f"{step} pushes"
        shown = {part: rows for part, rows in found["errors"].items() if rows}
        for part, rows in shown.items():
            table = markdown_table(COLUMNS, [_cells(name, row) for name, row in rows.items()])
            parts.append(f"### After {pushes}, {part}\n\n{table}\n")
        parts += [_ratios(key, values) for key, values in found.items() if "ratio_to" in key]
    return "".join(parts)


def _cells(name: str, row: dict[str, Any]) -> list[str]:
    return [
        name,
        str(row["windows"]),
        *(text.format(**row[disk]) for disk in ("target", "mid") for text in STATISTICS),
        f"{row['target_heading']['mean']:.0f}",
        f"{row['mid_heading']['mean']:.0f}",
        f"{100 * row['contacts_agreed']:.0f} %",
    ]


def _ratios(key: str, values: dict[str, list[float]]) -> str:
    below = key.removeprefix("ratio_to_")
    lines = [f"Mean target error over that of {below}:\n\n"]
    for name, (ratio, low, high) in values.items():
        lines.append(f"* {name}: {ratio:.2f} [{low:.2f}, {high:.2f}]\n")
    return "".join([*lines, "\n"])
