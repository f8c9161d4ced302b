"""Fits the planar prior's free parameters to pushes made in Bullet with the arm.

Both get the true masses, radii and friction, so that what is left is the prior's own error. The
floor stands beside it: the same push once more, in Bullet, from the state that was observed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import minimize

from sain_core.errors import DatasetError
from sain_core.scene import MID, POSITION, RADIUS, TARGET, Table
from sain_core.seeding import generator
from sain_core.types import Mask, Scalars, Scenes
from sain_model.data.dataset import Part
from sain_model.evaluation.errors import position_errors, target_moved
from sain_model.physics.planar import PlanarConfig, PlanarPrior
from sain_model.physics.planar_config import TEXTBOOK

FreeParameters = dict[str, tuple[float, float, float]]  # a step that matters, least, most

FREE: Final[FreeParameters] = {
    "friction_scale": (0.05, 0.8, 1.3),
    "yield_across": (0.2, 0.2, 1.0),
    "tool_friction": (0.04, 0.0, 0.4),
    "disk_friction": (0.04, 0.0, 0.4),
    "tool_restitution": (0.1, 0.0, 0.5),
    "disk_restitution": (0.1, 0.0, 0.5),
    "foot_radius": (0.05, 0.4, 1.0),
    "inertia": (0.05, 0.3, 0.8),
    "middle_height": (0.01, 0.0, 0.04),
    "tool_height": (0.01, 0.0, 0.05),
    "disk_height": (0.01, 0.0, 0.05),
}
AXES_FREE: Final[FreeParameters] = {
    "axes_yield": (0.2, 0.1, 1.5),
    **{name: range_ for name, range_ in FREE.items() if name != "yield_across"},
}
SMALL: Final = 1.0  # [mm], below which an error hardly counts
LARGE: Final = 15.0  # [mm], beyond which it counts no more

START: Final = TEXTBOOK  # what the parameters are before anything is fitted
AXES_START: Final = replace(START, axes_yield=0.7)

Progress = Callable[[int, float], None]  # evaluations so far, lowest cost


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
    evaluations: int,
    seed: int = 0,
    axes: bool = False,
    progress: Progress = lambda evaluations, cost: None,
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
    best = _fit(part, free, start, evaluations, progress)
    fitted = {name: float(getattr(best, name)) for name in free}
    return Calibration(best, fitted, len(part), _judge(rest, start, best))


def on_table(data: Part, table: Table) -> Mask:
    """Tell in which pushes (M,) every disk stood on the table with its whole rim, before and after.

    A disk that tips over the edge is no longer in the plane.
    """
    inside = np.ones(len(data), dtype=bool)
    for scenes in (data.state, data.next_state):
        places, radii = scenes[..., POSITION], scenes[..., RADIUS, None]
        inside &= (table.contains(places - radii) & table.contains(places + radii)).all(axis=-1)
    return inside


def _fit(
    data: Part, free: FreeParameters, first: PlanarConfig, evaluations: int, progress: Progress
) -> PlanarConfig:
    """Return the configuration with the lowest cost that Powell's method finds."""
    steps, lows, highs = (np.array(column) for column in zip(*free.values(), strict=True))
    start = np.array([getattr(first, name) for name in free])
    lowest, count = np.inf, 0

    def fitted(scaled: Scalars) -> PlanarConfig:
        values = np.round(np.clip(start + scaled * steps, lows, highs), 4).tolist()
        return replace(first, **dict(zip(free, values, strict=True)))

    def cost(scaled: Scalars) -> float:
        nonlocal lowest, count
        value = _cost(data, fitted(scaled))
        lowest, count = min(lowest, value), count + 1
        progress(count, lowest)
        return value

    found = minimize(
        cost,
        np.zeros(len(start)),
        method="Powell",
        bounds=list(zip((lows - start) / steps, (highs - start) / steps, strict=True)),
        options={"maxfev": evaluations, "xtol": 0.05, "ftol": 3e-4},
    )
    return fitted(found.x)


def _cost(data: Part, config: PlanarConfig) -> float:
    """Return how far off the prior is: about linear in the errors of target and mid disk."""
    predicted = PlanarPrior(config).step(data.state, data.action, {"friction": data.friction})
    off = 1e3 * np.linalg.norm((predicted - data.next_state)[..., POSITION], axis=-1)
    off = np.minimum(off[:, [MID, TARGET]], LARGE)
    return float((np.sqrt(SMALL**2 + off**2) + 0.02 * off**2).mean())


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
