"""The picture of learning curves: error over the number of transitions learned from."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from sain_model.evaluation.history_errors import SAIN_HISTORY
from sain_model.evaluation.metrics import BULLET, FLOOR, LEARNED, SAIN
from sain_model.evaluation.png import write_png
from sain_model.training.learning_curve import Point

COLORS: Final = {LEARNED: "#8a5fb0", SAIN: "#e8762c", SAIN_HISTORY: "#b8420f"}
GREYS: Final = ("#555555", "#777777", "#999999", "#bbbbbb")
LABELS: Final = {BULLET: "Bullet, nominal\n(f_p)"}


def save_curves(path: Path, points: Sequence[Point]) -> None:
    """Write a PNG with a curve and its 95 % band for each network, and a line for each physics."""
    figure = Figure(figsize=(7.5, 4.5), layout="constrained")
    axes = figure.subplots()
    networks = [point for point in points if point.transitions]
    sizes = sorted({point.transitions for point in networks})
    for name in dict.fromkeys(point.name for point in networks):
        _draw_network(axes, [point for point in networks if point.name == name])
    physics = [point for point in points if not point.transitions]
    for point, color in zip(physics, GREYS, strict=False):
        _draw_physics(axes, point, color)
    axes.set(xscale="log", yscale="log", xlabel="transitions learned from")
    axes.set_ylabel("target's mean error after one push [mm]")
    axes.set_xticks(sizes, [f"{size:,}" for size in sizes])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(FuncFormatter(lambda value, _: _leading(value)))
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, loc="best", fontsize=9)
    write_png(path, figure)


def _draw_network(axes: Axes, points: Sequence[Point]) -> None:
    points = sorted(points, key=lambda point: point.transitions)
    sizes = [point.transitions for point in points]
    color = COLORS.get(points[0].name, "#333333")
    axes.plot(sizes, [point.mean for point in points], "o-", color=color, label=points[0].name)
    lows, highs = [point.low for point in points], [point.high for point in points]
    axes.fill_between(sizes, lows, highs, color=color, alpha=0.15, linewidth=0)


def _draw_physics(axes: Axes, point: Point, color: str) -> None:
    style = ":" if point.name == FLOOR else "--"
    axes.axhline(point.mean, color=color, linestyle=style, linewidth=1.2, zorder=1)
    axes.annotate(
        LABELS.get(point.name, point.name),
        (1.0, point.mean),
        (4, 0),
        xycoords=axes.get_yaxis_transform(),
        textcoords="offset points",
        va="center",
        fontsize=8,
        color=color,
    )


def _leading(value: float) -> str:
    """Label 2 and 5 of each power of ten alone."""
    return f"{value:g}" if f"{value:e}"[0] in "25" else ""
