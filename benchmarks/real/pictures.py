"""The pictures of docs/reference/real.md, from the file of results alone."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.real.measures import Figures
from sain_core.view.figures import TEXT, new_figure, style_axes, write_png
from sain_core.view.palette import PALETTE

COLOURS: Final = {
    "still": PALETTE.other,
    "nominal": PALETTE.physics,
    "identified": PALETTE.identified,
    "sim_quadratic": PALETTE.reach_edge,
    "sim_poly4": PALETTE.mid,
    "learned": PALETTE.learned,
    "trees": PALETTE.goal,
    "trees_on_identified": PALETTE.success,
    "sain": PALETTE.predicted,
}
DASHED: Final = ("sim_quadratic", "sim_poly4", "trees_on_identified")  # of others
NOT_DRAWN: Final = ("still", "shipped", "shipped_physics")
NAMES: Final = tuple(f"real_{name}.png" for name in ("objects", "own"))
UNITS: Final = {"mm": "position error [mm]", "degrees": "heading error [degrees]"}


def draw_all(results: Figures, folder: Path) -> list[Path]:
    """Draw what results have, as PNG files in a folder, and return their paths."""
    drawers: tuple[Callable[[Figures], Figure | None], ...] = (
        by_object,
        by_own_pushes,
    )
    drawn = ((folder / name, draw(results)) for name, draw in zip(NAMES, drawers, strict=True))
    return [write_png(figure, path) for path, figure in drawn if figure is not None]


def colour_of(key: str) -> str:
    """Return the colour of a row; of one that is not ours, that of all others."""
    return COLOURS.get(key, PALETTE.other)


def _line(key: str) -> dict[str, Any]:
    heavy = key == "sain"
    return {
        "color": colour_of(key),
        "linestyle": "--" if key in DASHED else "-",
        "linewidth": 2.0 if heavy else 1.2,
        "marker": "o",
        "markersize": 4.5 if heavy else 3.0,
        "zorder": 3 if heavy else 2,
    }


def _legend(figure: Figure, axes: Axes, columns: int = 3) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(
        handles, labels, frameon=False, fontsize=TEXT, ncols=columns, loc="outside lower center"
    )


def by_object(results: Figures) -> Figure:
    """Draw the errors of each row by object."""
    groups = results["by_object"]
    names = sorted(groups)
    rows = [key for key in results["rows"] if key not in NOT_DRAWN]
    figure = new_figure(7.6, 4.9)
    for axes, (unit, title) in zip(figure.subplots(2, 1, sharex=True), UNITS.items(), strict=True):
        style_axes(axes, ylabel=title)
        for key in rows:
            values = [groups[group][unit][key] for group in names]
            axes.plot(range(len(names)), values, label=results["rows"][key], **_line(key))
        axes.set_ylim(bottom=0.0)
    counted = [f"{group}\n({groups[group]['pushes']:,})" for group in names]
    axes.set_xticks(range(len(names)), counted)
    _legend(figure, axes)
    return figure


def own_counts(results: Figures) -> list[int]:
    """Return for which numbers of own pushes there are errors with each object left out."""
    parts = [key.partition("_") for key in results["cases"]]
    return sorted(int(count) for name, _, count in parts if name == "object")


def by_own_pushes(results: Figures) -> Figure | None:
    """Draw the errors on objects that were left out by the number of own pushes."""
    counts = own_counts(results)
    if not counts:
        return None
    figure = new_figure(7.6, 3.9)
    for axes, (unit, title) in zip(figure.subplots(1, 2), UNITS.items(), strict=True):
        style_axes(axes, ylabel=title, xlabel="own pushes of the body")
        for key, label in results["rows"].items():
            if key in NOT_DRAWN:
                continue
            cases = [results["cases"][f"object_{count}"]["errors"] for count in counts]
            found = [case[key][unit] if key in case else [np.nan] * 3 for case in cases]
            mean, low, high = np.array(found).T
            places = np.log(np.array(counts) + 1.0)[~np.isnan(mean)]
            mean, low, high = (part[~np.isnan(part)] for part in (mean, low, high))
            axes.plot(places, mean, label=label, **_line(key))
            axes.fill_between(places, low, high, color=colour_of(key), alpha=0.12, linewidth=0)
        axes.set_xticks(np.log(np.array(counts) + 1.0), [str(count) for count in counts])
        axes.set_ylim(bottom=0.0)
    _legend(figure, axes)
    return figure
