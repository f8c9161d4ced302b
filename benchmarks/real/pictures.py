"""The pictures of docs/reference/real.md, from the file of results alone."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon

from benchmarks.real.measures import Figures
from benchmarks.real.rows import LEVELS
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
NAMES: Final = tuple(
    f"real_{name}.png" for name in ("objects", "angles", "own", "field", "pushes", "regions")
)
UNITS: Final = {"mm": "position error [mm]", "degrees": "heading error [degrees]"}
PARTS: Final = ("nominal", "identified", "sain")  # whose residuals are drawn


def draw_all(results: Figures, folder: Path) -> list[Path]:
    """Draw what results have, as PNG files in a folder, and return their paths."""
    drawers: tuple[Callable[[Figures], Figure | None], ...] = (
        by_object,
        by_angle,
        by_own_pushes,
        residual_field,
        six_pushes,
        calibration,
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
    return _by_group(results, "by_object", "")


def by_angle(results: Figures) -> Figure:
    """Draw the errors of each row by the angle between motion and normal."""
    return _by_group(results, "by_angle", "angle between motion and normal [degrees]")


def _by_group(results: Figures, name: str, label: str) -> Figure:
    groups = results[name]
    names = sorted(groups, key=lambda group: (group == "no contact", _number(group), group))
    rows = [key for key in results["rows"] if key not in NOT_DRAWN]
    figure = new_figure(7.6, 4.9)
    for axes, (unit, title) in zip(figure.subplots(2, 1, sharex=True), UNITS.items(), strict=True):
        style_axes(axes, ylabel=title, xlabel=label if unit == "degrees" else "")
        for key in rows:
            values = [groups[group][unit][key] for group in names]
            axes.plot(range(len(names)), values, label=results["rows"][key], **_line(key))
        axes.set_ylim(bottom=0.0)
    counted = [f"{group}\n({groups[group]['pushes']:,})" for group in names]
    axes.set_xticks(range(len(names)), counted)
    _legend(figure, axes)
    return figure


def _number(group: str) -> int:
    first = group.partition(" ")[0]
    return int(first) if first.isdigit() else 0


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


def residual_field(results: Figures) -> Figure:
    """Draw what predictions leave on one object as arrows, over contact and angle."""
    field = results["field"]
    height, width = field["size"]
    keys = [key for key in PARTS if key in field["residuals"]] or list(field["residuals"])[:1]
    figure = new_figure(7.6, 0.5 + 1.9 * len(keys))
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) * 180 / height)
    spins = [np.array(field["residuals"][key][2]) for key in keys]
    most = max(float(np.nanquantile(np.abs(spin), 0.95)) for spin in spins)
    several = figure.subplots(len(keys), 1, sharex=True, squeeze=False)[:, 0]
    for axes, key in zip(several, keys, strict=True):
        forward, left, spin = (
            np.array(part).reshape(height, width) for part in field["residuals"][key]
        )
        style_axes(axes, title=results["rows"][key], grid=None, ylabel="angle [degrees]")
        for corner in field["corners"]:
            axes.axvline(corner, color=PALETTE.line, linewidth=1.0, zorder=0)
        arrows = axes.quiver(
            x, y - 90.0, -left, forward, spin, cmap="coolwarm", clim=(-most, most), pivot="middle",
            angles="uv", scale=3.2 * width, width=0.0028, headwidth=3.5,
        )  # fmt: skip
        axes.set_ylim(-95.0, 95.0)
        axes.set_yticks([-60, 0, 60])
        axes.quiverkey(arrows, 0.93, 1.08, 5.0, "5 mm", labelpos="E", fontproperties={"size": TEXT})
    several[-1].set_xlabel("contact along the outline, share of it", fontsize=TEXT)
    bar = figure.colorbar(arrows, ax=list(several), shrink=0.7, aspect=30, pad=0.01)
    bar.set_label("heading [degrees]", fontsize=TEXT, color=PALETTE.ink)
    bar.ax.tick_params(labelsize=TEXT - 1)
    return figure


def six_pushes(results: Figures) -> Figure:
    """Draw single pushes: before, after, and as predicted."""
    figure = new_figure(7.6, 5.6)
    for axes, push in zip(figure.subplots(2, 3).flat, results["examples"], strict=False):
        (start, end, radius), before = push["tool"], np.array(push["before"])
        axes.add_patch(Polygon(before, fill=False, edgecolor=PALETTE.table_edge, linewidth=1.0))
        after = Polygon(np.array(push["after"]), facecolor=PALETTE.reach, edgecolor=PALETTE.ink)
        axes.add_patch(after)
        after.set_linewidth(1.2)
        axes.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": PALETTE.alarm})
        axes.add_patch(Circle(end, radius, color=PALETTE.alarm, linewidth=0, alpha=0.8))
        shown = [key for key in PARTS if key in push["predicted"]]
        for key in shown:
            corners = np.array(push["predicted"][key])
            line: dict[str, Any] = {
                "edgecolor": colour_of(key),
                "linewidth": 2.0 if key == "sain" else 1.2,
            }
            axes.add_patch(Polygon(corners, fill=False, label=results["rows"][key], **line))
        said = ", ".join(f"{push['mm'][key]:.1f}" for key in shown)
        style_axes(axes, title=f"{push['object']} on {push['surface']}", grid=None)
        axes.set_xlabel(f"{said} mm" if said else "", fontsize=TEXT)
        axes.set_aspect("equal", adjustable="datalim")
        axes.autoscale_view()
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines[:].set_visible(False)
    _legend(figure, axes)
    return figure


def calibration(results: Figures) -> Figure | None:
    """Draw how often regions hold what happened over their level, in several cases."""
    chosen = {
        key: case
        for key, case in results["cases"].items()
        if key in ("folds", "object_20", "surface_20") and case["regions"]
    }
    if not chosen:
        return None
    figure = new_figure(7.6, 3.8)
    styles = {"folds": "-", "object_20": "--", "surface_20": ":"}
    titles = {"mm": "regions of the position", "degrees": "intervals of the heading"}
    for axes, unit in zip(figure.subplots(1, 2, sharey=True), UNITS, strict=True):
        style_axes(axes, title=titles[unit], grid="both", xlabel="level [%]")
        axes.plot([0, 100], [0, 100], color=PALETTE.other, linewidth=1.0)
        for key, case in chosen.items():
            for row, found in case["regions"].items():
                if unit not in found:
                    continue
                held = 100.0 * np.array(found[unit]["held"])
                line = _line(row) | {"linestyle": styles[key]}
                label = f"{results['rows'][row]}, {case['title'].removesuffix(' of each body')}"
                axes.plot(100.0 * np.array(LEVELS), held, label=label, **line)
        axes.set(xlim=(0, 100), ylim=(0, 100))
    figure.axes[0].set_ylabel("held [%]", fontsize=TEXT, color=PALETTE.ink)
    _legend(figure, figure.axes[0], columns=2)
    return figure
