"""Fits the planar prior's free parameters to pushes made in Bullet with the arm.

Both get the true masses, radii and friction, so that what is left is the prior's own error. The
floor stands beside it: the same push once more, in Bullet, from the state that was observed.
"""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from sain_core.errors import DatasetError
from sain_core.randomness import generator
from sain_core.scene import MID, POSITION, RADIUS, TARGET, Table
from sain_core.types import Mask, Scenes
from sain_model.data.dataset import Part
from sain_model.evaluation.errors import position_errors, target_moved
from sain_model.inference.gauss_newton import Progress, fit
from sain_model.inference.kinds import ACROSS, ALONG_AXES, FRICTION, Kind
from sain_model.physics.parameters import TEXTBOOK
from sain_model.physics.planar import PlanarConfig, PlanarPrior

FREE: Final = (
    "friction_scale",
    ACROSS,
    "tool_friction",
    "disk_friction",
    "tool_restitution",
    "disk_restitution",
    "foot_radius",
    "inertia",
    "middle_height",
    "tool_height",
    "disk_height",
)
AXES_FREE: Final = tuple(ALONG_AXES if name == ACROSS else name for name in FREE)
WIDE: Final = 3.0  # standard deviation of z beforehand: many pushes decide

START: Final = TEXTBOOK  # what the parameters are before anything is fitted
AXES_START: Final = replace(START, axes_yield=0.7)


Accuracy = dict[str, float]  # number of pushes, and errors of position over them [mm]


@dataclass(frozen=True)
class Calibration:
    """What came of it; accuracies are on episodes that nothing was fitted to.

    Attributes:
        config: the prior with its fitted parameters.
        fitted: those parameters alone.
        fit_pushes: how many pushes they were fitted to.
        accuracy: by part of the pushes ("all", "target_moved"), then by who predicts.
    """

    config: PlanarConfig
    fitted: dict[str, float]
    fit_pushes: int
    accuracy: dict[str, dict[str, Accuracy]]


def calibrate(
    data: Part,
    fit_share: float,
    steps: int,
    seed: int = 0,
    axes: bool = False,
    progress: Progress = lambda steps, score: None,
) -> Calibration:
    """Fit the free parameters to a share of the episodes and judge them on the others.

    With `axes` the prior is fitted whose friction depends on the world's axes.

    Raises:
        DatasetError: the true friction is not known, or no push is left on the table.
    """
    if not np.isfinite(data.friction).all():
        raise DatasetError("the data has no true friction; collect it with `sain_sim collect`")
    data = data.select(on_table(data, Table()))
    numbers = generator(seed, "calibrate").permutation(np.unique(data.episode))
    fitting = np.isin(data.episode, numbers[: round(fit_share * len(numbers))])
    moved = target_moved(data.state, data.next_state)
    part, rest = data.select(fitting & moved), data.select(~fitting)
    if not len(part) or not len(rest):
        raise DatasetError(f"{len(data)} pushes of {len(numbers)} episodes are too few to fit")
    free, start = (AXES_FREE, AXES_START) if axes else (FREE, START)
    kind = Kind("planar", PlanarPrior(start), free, WIDE**2 * np.eye(len(free)))
    given = {FRICTION: part.friction}
    pushes = replace(part.observed.in_episodes(np.zeros(len(part), np.int64)), given=given)
    found = fit(kind, [pushes], np.zeros((1, len(free))), np.zeros(1, np.int64), steps, progress)
    values = {name: float(value[0].round(4)) for name, value in kind.values(found.places).items()}
    settings: dict[str, Any] = {**values}
    best = replace(start, **settings)
    return Calibration(best, values, len(part), _judge(rest, start, best))


def on_table(data: Part, table: Table) -> Mask:
    """Tell in which pushes (M,) every disk stood on the table with its whole rim, before and after.

    A disk that tips over the edge is no longer in the plane.
    """
    inside = np.ones(len(data), dtype=bool)
    for scenes in (data.state, data.next_state):
        places, radii = scenes[..., POSITION], scenes[..., RADIUS, None]
        inside &= (table.contains(places - radii) & table.contains(places + radii)).all(axis=-1)
    return inside


def _judge(data: Part, start: PlanarConfig, fitted: PlanarConfig) -> dict[str, dict[str, Accuracy]]:
    predictions = {
        "before": PlanarPrior(start).step(data.state, data.action, {"friction": data.friction}),
        "fitted": PlanarPrior(fitted).step(data.state, data.action, {"friction": data.friction}),
        "in use": PlanarPrior().step(data.state, data.action, {"friction": data.friction}),
        "floor": data.floor_next,
    }
    moved = target_moved(data.state, data.next_state)
    parts = {"all": np.ones(len(data), dtype=bool), "target_moved": moved}
    return {
        part: {
            name: accuracy(predicted[rows & known], data.next_state[rows & known])
            for name, predicted in predictions.items()
            if (rows & (known := np.isfinite(predicted).all(axis=(1, 2)))).any()
        }
        for part, rows in parts.items()
    }


def accuracy(predicted: Scenes, actual: Scenes) -> Accuracy:
    """Return the errors of predicted scenes (M, N, 8)."""
    figures: Accuracy = {"pushes": len(predicted)}
    for name, disk in (("target", TARGET), ("mid", MID)):
        errors = position_errors(predicted, actual, disk)
        figures[f"{name}_mean"] = float(errors.mean())
        figures[f"{name}_median"] = float(np.median(errors))
        figures[f"{name}_p95"] = float(np.quantile(errors, 0.95))
    return figures
