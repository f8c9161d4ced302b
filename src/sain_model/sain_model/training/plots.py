"""The pictures of a training: losses over epochs, and learning curves."""

from collections.abc import Sequence
from itertools import cycle
from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from sain_core.view.figures import TEXT, new_figure, style_axes
from sain_core.view.palette import PALETTE
from sain_model.evaluation.predictors import BULLET, FLOOR, LEARNED, SAIN, SAIN_HISTORY
from sain_model.training.learning_curve import Point
from sain_model.training.trainer import LossHistory

COLOURS: Final = {
    LEARNED: PALETTE.learned,
    SAIN: PALETTE.predicted,
    SAIN_HISTORY: PALETTE.history,
    FLOOR: PALETTE.floor,
}
STYLES: Final = ("-", "--", "-.", (0, (6, 2, 1, 2, 1, 2)))  # of physics, each with its own
LABELS: Final = {BULLET: "Bullet, nominal (f_p)"}


def draw_curves(points: Sequence[Point]) -> Figure:
    """Draw a curve with its 95 % band for each network, and a line for each physics."""
    figure = new_figure(6.6, 5.2)
    axes = figure.subplots()
    style_axes(axes, grid="both", xlabel="training data [transitions]")
    axes.set_ylabel("target's mean error after one push [mm]", fontsize=TEXT)
    networks = [point for point in points if point.transitions]
    styles = cycle(STYLES)
    for point in points:
        if not point.transitions:
            style = ":" if point.name == FLOOR else next(styles)
            colour = COLOURS.get(point.name, PALETTE.physics)
            label = LABELS.get(point.name, point.name)
            axes.axhline(point.mean, color=colour, linestyle=style, linewidth=1.3, label=label)
    for name in dict.fromkeys(point.name for point in networks):
        _draw_network(axes, [point for point in networks if point.name == name])
    _scale(axes, sorted({point.transitions for point in networks}))
    figure.legend(frameon=False, loc="outside lower center", ncols=3, fontsize=TEXT)
    return figure


def _scale(axes: Axes, sizes: Sequence[int]) -> None:
    axes.set(xscale="log", yscale="log")
    axes.set_xticks(sizes, [f"{size:,}" for size in sizes])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(FuncFormatter(lambda value, _: _leading(value)))


def _draw_network(axes: Axes, points: Sequence[Point]) -> None:
    points = sorted(points, key=lambda point: point.transitions)
    sizes = [point.transitions for point in points]
    colour, label = COLOURS.get(points[0].name, PALETTE.inside), f"{points[0].name}, 95 % band"
    axes.plot(sizes, [point.mean for point in points], "o-", color=colour, label=label)
    lows, highs = [point.low for point in points], [point.high for point in points]
    axes.fill_between(sizes, lows, highs, color=colour, alpha=0.15, linewidth=0)


def _leading(value: float) -> str:
    """Label 2 and 5 of each power of ten alone."""
    return f"{value:g}" if f"{value:e}"[0] in "25" else ""


def draw_losses(history: LossHistory) -> Figure:
    """Draw the losses after each epoch, the weights that are kept marked."""
    figure = new_figure(6.0, 4.0)
    axes = figure.subplots()
    style_axes(axes, grid="both", xlabel="epoch", ylabel="loss, mean over transitions")
    epochs = range(1, len(history.train) + 1)
    axes.plot(epochs, history.train, label="training", color=PALETTE.physics)
    axes.plot(epochs, history.validation, label="validation", color=PALETTE.predicted)
    kept = f"kept: epoch {history.best + 1}, {history.best_loss:.4g}"
    axes.plot(history.best + 1, history.best_loss, "o", color=PALETTE.predicted, label=kept)
    if history.start is not None:
        before = "validation before the training"
        axes.axhline(history.start, color=PALETTE.floor, linestyle=":", label=before)
    figure.legend(frameon=False, loc="outside lower center", ncols=2, fontsize=TEXT)
    return figure
