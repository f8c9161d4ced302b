"""Open loop: models rolled out over successive pushes, with nothing seen in between.

A push is what the planner means by it: its numbers are relative to the mid disk, in a model to
where the model itself believes the mid disk to be, in truth to where it was
(docs/explanation/rollouts.md).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.model import IdentityPrior, Model
from sain_core.push import LENGTH
from sain_core.types import Pushes, Scalars, Scenes
from sain_model.data.dataset import Dataset
from sain_model.data.windows import Windows, make_windows
from sain_model.dynamics.sain import RECURRENT, RESIDUAL, SainDynamics
from sain_model.dynamics.settings import STEPS
from sain_model.evaluation.baselines import step_as_nominal
from sain_model.evaluation.history_errors import earlier_friction, earlier_pushes
from sain_model.evaluation.metrics import BULLET, FLOOR, MEASURED, NO_MOTION, NOMINAL
from sain_model.physics.friction import FrictionFilter
from sain_model.physics.planar import PlanarPrior

HISTORY: Final = ", history"
TRUE_FRICTION: Final = "planar, true friction"
RESIDUAL_SAIN: Final = "residual SAIN"
RECURRENT_SAIN: Final = "recurrent SAIN"
NAMES: Final = {RESIDUAL: RESIDUAL_SAIN, RECURRENT: RECURRENT_SAIN}  # of a model's kind

Rollouts = Float[ndarray, "W T N 8"]


@dataclass(frozen=True, eq=False)
class OpenLoop:
    """What every predictor says over the same windows."""

    windows: Windows
    predictions: dict[str, Rollouts]  # of each by its name; NaN where it cannot say
    earlier: Int[ndarray, "W"]  # how many pushes came before each window in its episode


class NominalPlanar(Model):
    """The planar prior that believes every disk to have nominal mass and radius."""

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes (B, 5) from scenes (B, N, 8)."""
        return step_as_nominal(PlanarPrior(), scenes, pushes)


def roll_out(
    dynamics: Model, scenes: Scenes, pushes: ndarray, friction: Scalars | None = None
) -> Rollouts:
    """Predict scenes (W, T, N, 8) for push sequences (W, T, 3), each from its own scene.

    Args:
        dynamics: fed with its own predictions.
        scenes: (W, N, 8), what is seen at first.
        pushes: (W, T, 3); those of zero length move nothing.
        friction: what a dynamics that can be told is told (W,); None: nothing.
    """
    predicted = np.empty((*pushes.shape[:2], *scenes.shape[1:]))
    current = scenes.copy()
    for step in range(pushes.shape[1]):
        moving = pushes[:, step, LENGTH] > 0.0
        if moving.any():
            told = () if friction is None else ({"friction": friction[moving]},)
            current[moving] = dynamics.step(current[moving], pushes[moving, step], *told)
        predicted[:, step] = current
    return predicted


def predict_open_loop(
    data: Dataset,
    models: Mapping[str, Model],
    steps: int = max(STEPS),
    others: Mapping[str, Model] | None = None,
) -> OpenLoop:
    """Return what physics and models say over all windows of at most so many pushes.

    Args:
        data: pushes that no model was trained on.
        models: by name; each that learns friction is asked with and without history.
        steps: the most pushes of a window.
        others: more physics by name, which history does not tell anything.
    """
    windows = make_windows(data, steps)
    first = windows.rows[:, 0]
    planar = PlanarPrior()
    everyone: dict[str, Model] = {
        NO_MOTION: IdentityPrior(),
        NOMINAL: NominalPlanar(),
        MEASURED: planar,
        **(others or {}),
        **models,
    }
    predictions = {
        name: roll_out(dynamics, windows.scenes, windows.pushes)
        for name, dynamics in everyone.items()
    }
    known = np.isfinite(data.friction[first])
    predictions[TRUE_FRICTION] = np.full_like(predictions[MEASURED], np.nan)
    predictions[TRUE_FRICTION][known] = roll_out(
        planar, windows.scenes[known], windows.pushes[known], data.friction[first][known]
    )
    learners: list[tuple[str, Model, FrictionFilter]] = [(MEASURED, planar, planar.filter())]
    for name, model in models.items():
        if isinstance(model, SainDynamics) and model.filter is not None:
            learners.append((name, model, model.filter))
    for name, model, friction in learners:
        told = earlier_friction(friction, data).mean[first]
        predictions[name + HISTORY] = roll_out(model, windows.scenes, windows.pushes, told)
    for name, scenes in ((BULLET, data.physics_next), (FLOOR, data.floor_next)):
        # recorded for single pushes: known for the first one of a window alone
        predictions[name] = np.full_like(windows.next_scenes, np.nan)
        predictions[name][:, 0] = scenes[first]
    return OpenLoop(windows, predictions, earlier_pushes(data)[first])
