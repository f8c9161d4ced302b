"""What there is to compare: physics, models, and what each makes of an episode's earlier pushes.

All are rolled out over the same windows of successive pushes. After one push, a rollout is a
prediction of a single push. A push is what the planner means by it: its numbers are relative to
the pushed body, in a model to where the model itself predicts that body to be, in truth to where
it was (docs/explanation/rollouts.md).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.model import IdentityPrior, Model, answering, check_step
from sain_core.push import LENGTH
from sain_core.types import Indices, Pushes, Scalars, Scenes
from sain_model.data.dataset import Dataset, Part, Windows, make_windows
from sain_model.dynamics.identify import body_names
from sain_model.dynamics.intervals import Prediction
from sain_model.dynamics.sain import LEARNED as LEARNED_KIND
from sain_model.dynamics.sain import RECURRENT, RESIDUAL, SainDynamics
from sain_model.inference.evidence import Known
from sain_model.inference.kinds import FRICTION, friction_belief
from sain_model.inference.posterior import Posterior
from sain_model.physics.planar import PlanarPrior

AT_ONCE: Final = 32  # pushes between two looks at the clock


NO_MOTION: Final = "no motion"
BULLET: Final = "bullet, nominal"
MEASURED: Final = "planar, measured"
FLOOR: Final = "floor"
LEARNED: Final = "learned only"
SAIN: Final = "SAIN"
RECURRENT_SAIN: Final = "recurrent SAIN"
HISTORY: Final = ", history"
TRUE: Final = ", true friction"
PLANAR_HISTORY: Final = "planar, history"
PLANAR_TRUE: Final = "planar, true friction"
PRIOR: Final = "its prior"
PRIOR_HISTORY: Final = PRIOR + HISTORY
SAIN_HISTORY: Final = SAIN + HISTORY
NAMES: Final = {  # of a model's kind, the paper's Fig. 1
    LEARNED_KIND: LEARNED,
    RESIDUAL: SAIN,
    RECURRENT: RECURRENT_SAIN,
}

Rollouts = Float[ndarray, "W T N 8"]
Predictor = Callable[[Scenes, Pushes, Indices], Scenes]
"""Predicts pushes from scenes with what is known at these rows of a part."""
Advance = Callable[[str, int], None]  # called with the name of a model, and how many pushes it did


@dataclass(frozen=True, eq=False)
class Predictions:
    """What all predictors say over the same windows of one part."""

    part: Part  # the data
    windows: Windows  # of successive pushes; one begins at every push
    by_name: dict[str, Rollouts]  # rollouts; NaN where a predictor says nothing
    regions: dict[str, Prediction]  # of models that have any, for the first push of each window
    earlier: Int[ndarray, "W"]  # how many pushes came before each window in its episode


def predict_all(
    data: Dataset,
    models: Mapping[str, Model],
    steps: int = 1,
    others: Mapping[str, Model] | None = None,
    advance: Advance = lambda name, pushes: None,
) -> list[Predictions]:
    """Return what physics and models say over all windows of at most so many pushes, by part.

    Each model that infers from pushes is asked with and without history. The prior of the first one
    is asked, too. `others` are more physics by name, without history; `advance` follows these.
    """
    found = []
    for part in data.parts:
        physics = {
            name: checked(name, model.with_bodies(part.bodies), advance)
            for name, model in (others or {}).items()
        }
        found.append(_predict_part(part, models, make_windows(part, steps), physics))
    return found


def _predict_part(
    part: Part, models: Mapping[str, Model], windows: Windows, others: Mapping[str, Predictor]
) -> Predictions:
    planar = PlanarPrior(bodies=part.bodies)
    learning = SainDynamics(friction_belief(planar), bodies=part.bodies)
    predictors: dict[str, Predictor] = {
        NO_MOTION: plain(IdentityPrior()),
        MEASURED: plain(planar),
        PLANAR_TRUE: _with_friction(planar, part.friction),
        PLANAR_HISTORY: with_history(learning, inferred_rows(learning, part)),
    }
    predictors |= others
    regions: dict[str, Prediction] = {}
    first = next(iter(models.values()), None)
    for name, given in models.items():
        model = given.with_bodies(part.bodies)
        predictors[name] = plain(model)
        if not isinstance(model, SainDynamics):
            continue
        rows = inferred_rows(model, part) if model.infers else None
        if rows is not None:
            predictors[name + HISTORY] = with_history(model, rows)
            predictors[name + TRUE] = _with_friction(model, part.friction)
            if PRIOR_HISTORY not in predictors:
                alone = model.physics_alone()
                predictors[PRIOR_HISTORY] = with_history(alone, inferred_rows(alone, part))
        elif given is first:
            predictors[PRIOR] = plain(model.physics)
        prediction = predict_with_history(model, part, rows)
        if prediction.radius is not None:
            regions[name + HISTORY if model.infers else name] = prediction
    by_name = {name: roll_out(one, windows) for name, one in predictors.items()}
    for name, scenes in ((BULLET, part.physics_next), (FLOOR, part.floor_next)):
        # recorded for single pushes
        by_name[name] = np.full_like(windows.next_scenes, np.nan)
        by_name[name][:, 0] = scenes
    return Predictions(part, windows, by_name, regions, earlier(part).counts)


def roll_out(predictor: Predictor, windows: Windows) -> Rollouts:
    """Predict all windows, each from its own scene, fed with its own predictions.

    Pushes of zero length move nothing.
    """
    predicted = np.empty((*windows.pushes.shape[:2], *windows.scenes.shape[1:]))
    current = windows.scenes.copy()
    for step in range(windows.steps):
        moving = windows.pushes[:, step, LENGTH] > 0.0
        if moving.any():
            pushes, rows = windows.pushes[moving, step], windows.rows[moving, 0]
            current[moving] = predictor(current[moving], pushes, rows)
        predicted[:, step] = current
    return predicted


def checked(name: str, model: Model, advance: Advance) -> Predictor:
    """Return what another package's model predicts; how many pushes are done is reported.

    The predictor raises `ModelUnavailableError` where the model fails, or its answer cannot be one.
    """
    label = f"model {name!r}"

    def step(scenes: Scenes, pushes: Pushes, _: Indices) -> Scenes:
        predicted = np.empty_like(scenes)
        for first in range(0, len(pushes), AT_ONCE):
            rows = slice(first, first + AT_ONCE)
            with answering(label):
                answer = model.step(scenes[rows], pushes[rows])
            predicted[rows] = check_step(answer, scenes[rows], label)
            advance(name, len(pushes[rows]))
        return predicted

    return step


def plain(model: Model) -> Predictor:
    """Return what a model predicts without any history."""
    return lambda scenes, pushes, _: model.step(scenes, pushes)


def _with_friction(model: SainDynamics | PlanarPrior, friction: Scalars) -> Predictor:
    """Return a model that is given a friction (M,); NaN where that is not known."""

    def step(scenes: Scenes, pushes: Pushes, rows: Indices) -> Scenes:
        given = friction[rows]
        known, after = np.isfinite(given), np.full_like(scenes, np.nan)
        if known.any():
            after[known] = model.step(scenes[known], pushes[known], {FRICTION: given[known]})
        return after

    return step


# --- history --------------------------------------------------------------------------------------


def earlier(part: Part) -> Known:
    """Return a row for each push, with the earlier pushes of its episode."""
    return Known.earlier(part.episode, part.step)


def inferred_rows(model: SainDynamics, part: Part) -> Posterior:
    """Return for each push what its earlier pushes say: those of its episode, or of its body."""
    if model.belief.likeliest.of_bodies:
        body = np.unique(body_names(part), return_inverse=True)[1]
        return model.infer(part, Known.earlier(body, np.arange(len(part))))
    return model.infer(part, earlier(part))


def with_history(model: SainDynamics, rows: Posterior) -> Predictor:
    """Return what a model predicts as in deployment: with what was inferred for each push."""
    return lambda scenes, pushes, some: model.step_rows(scenes, pushes, rows.of_rows(some))[1]


def predict_with_history(
    model: SainDynamics, part: Part, rows: Posterior | None = None
) -> Prediction:
    """Return predictions as in deployment, with what the episode's earlier pushes say.

    Regions are wider where earlier errors were larger than in training. `rows`: what was inferred.
    """
    shaped = model.with_bodies(part.bodies)
    if not shaped.infers:
        return shaped.predict(part.state, part.action)
    rows = rows or inferred_rows(shaped, part)
    prediction = shaped.predict_rows(part.state, part.action, rows)
    intervals = shaped.network and shaped.network.intervals
    if not intervals or not intervals.adapts:
        return prediction
    known = earlier(part)
    total = known.total(intervals.excess(prediction, part).T).T
    return prediction.widened(intervals.widening(total, known.counts))
