"""Learning curves: how many transitions a network needs, with physics under it and without."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from pathlib import Path
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from sain_core.errors import CheckpointError
from sain_core.guarding.untrusted import read_json
from sain_core.output import write_json
from sain_core.view.figures import TEXT, new_figure, style_axes
from sain_core.view.palette import PALETTE
from sain_model.data.dataset import Split, check_held_out, limit_training
from sain_model.evaluation.errors import MM, TARGETS, evaluate
from sain_model.evaluation.predictors import (
    BULLET,
    FLOOR,
    LEARNED,
    MEASURED,
    NAMES,
    PLANAR_HISTORY,
    SAIN,
    SAIN_HISTORY,
)
from sain_model.network.settings import IDENTITY
from sain_model.training.fit import fit, trained_kind
from sain_model.training.settings import TrainingConfig

PHYSICS: Final = (BULLET, MEASURED, PLANAR_HISTORY, FLOOR)
NETWORKS: Final = (LEARNED, SAIN, SAIN_HISTORY)


@dataclass(frozen=True)
class Point:
    """The target's mean error of one predictor on held-out episodes, with 95 % interval [mm]."""

    name: str
    transitions: int  # that a network was trained on; 0 for physics
    mean: float
    low: float
    high: float


def learning_curve(
    split: Split,
    config: TrainingConfig,
    sizes: Sequence[int],
    steps: int,
    folder: Path,
    progress: Callable[[str, int], None] = lambda prior, size: None,
) -> list[Point]:
    """Train on more and more transitions, alone and on a prior, and measure on what is held out.

    Every network takes the same number of steps. What is done stays in the folder; a call that was
    stopped goes on from there.

    Args:
        split: sizes are taken from its training part.
        config: of every network, but for epochs and, for the network alone, the prior.
        sizes: numbers of transitions to train on.
        steps: of the optimiser.
        folder: for the state of each training, and its errors.
        progress: called with the prior and the size of each training that begins.

    Raises:
        DatasetError: a size that there are not so many transitions for, or nothing is held out.
        CheckpointError: the folder's state is damaged or of other settings or data.
    """
    check_held_out(split)
    points: dict[tuple[str, int], Point] = {}
    for size, part in [(size, limit_training(split, size)) for size in sizes]:
        for prior in (IDENTITY, config.prior):
            progress(prior, size)
            settings = replace(config, prior=prior, epochs=_epochs(config, size, steps))
            errors = _errors(part, settings, folder / f"{prior}-{size}")
            for name in (*PHYSICS, *NETWORKS):
                if row := errors.get(name):
                    trained = size if name in NETWORKS else 0
                    points[name, trained] = Point(name, trained, *row[MM])
    return list(points.values())


def _epochs(config: TrainingConfig, size: int, steps: int) -> int:
    return max(round(steps * config.batch / (size * (2 if config.mirrors else 1))), 1)


def _errors(split: Split, config: TrainingConfig, folder: Path) -> dict[str, dict[str, Any]]:
    """Return the errors on all held-out pushes by predictor; from the folder, if they are there."""
    path = folder / "errors.json"
    identity = f"{config} {split.train.sha256} {len(split.test)}"
    if path.exists():
        try:
            done = read_json(path)
            if done["identity"] != identity:
                raise CheckpointError(
                    f"{path} belongs to other settings or data; use another folder"
                )
            return dict(done["errors"])
        except (OSError, LookupError, TypeError, ValueError) as error:
            raise CheckpointError(f"{path} is damaged ({error}); use another folder") from error
    model, _ = fit(split, trained_kind(config), config, folder)
    errors = evaluate(split.test, {NAMES[model.origin.kind]: model})["after"]["1"]["errors"][
        TARGETS
    ]
    write_json(path, {"identity": identity, "errors": errors})
    return dict(errors)


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
