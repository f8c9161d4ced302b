"""Errors of physics and models, each with what it makes of an episode's earlier pushes.

All are rolled out over the same windows of successive pushes. After one push, a rollout is a
prediction of a single push. A push is what the planner means by it: its numbers are relative to
the pushed body, in a model to where the model itself predicts that body to be, in truth to where
it was (docs/explanation/rollouts.md). Errors have a row for each body of each push. Groups are
those of the target, of pushed bodies, of bodies that moved, of each shape, and by the number of
earlier pushes. Intervals are a bootstrap's over episodes.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.model import IdentityPrior, Model, answering, check_step
from sain_core.push import LENGTH, pushed_bodies
from sain_core.randomness import Interval, bootstrap_mean, bootstrap_ratio, generator
from sain_core.scene import POSITION, TARGET, THETA, wrap_angle
from sain_core.transitions import MOVED
from sain_core.types import Indices, Mask, Pushes, Scalars, Scenes
from sain_model.data.dataset import Dataset, Part, Windows, make_windows
from sain_model.dynamics.identify import believed_places, body_names
from sain_model.dynamics.intervals import Prediction
from sain_model.dynamics.sain import LEARNED as LEARNED_KIND
from sain_model.dynamics.sain import RECURRENT, RESIDUAL, SainDynamics
from sain_model.inference.evidence import Known
from sain_model.inference.kinds import FRICTION, friction_belief
from sain_model.inference.population import Population
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


def predict_known(
    model: SainDynamics, part: Part, bodies: Population, corrected: bool = True
) -> Prediction:
    """Return predictions with what is believed of each body, by its name; or of physics alone."""
    named = bool(bodies.kind.names)
    places = believed_places(part, bodies) if named else np.zeros((len(part), 0))
    rows = Posterior.at(model.belief, 0, places, np.full(len(part), corrected))
    return model.with_bodies(part.bodies).predict_rows(part.state, part.action, rows)


def predict_with_history(
    model: SainDynamics, part: Part, rows: Posterior | None = None
) -> Prediction:
    """Return predictions as in deployment, with what the episode's earlier pushes say.

    Regions follow the errors of earlier pushes. `rows`: what was inferred.
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
    total = known.total(intervals.curves(prediction, part))
    return prediction.widened(intervals.widening(total, known.counts))


# --- errors ---------------------------------------------------------------------------------------

ENOUGH: Final = 3  # earlier pushes from which on they are taken together
BELOW_ALL: Final = (FLOOR, PLANAR_TRUE, NO_MOTION)  # no physics that could be had
TARGETS: Final = "target"
TARGET_MOVED: Final = "target, moved"
TARGET_MISSED: Final = "target, not moved"
PUSHED: Final = "pushed"
MM, DEG = "mm", "deg"
LEAST: Final = 0.005  # [mm] or [deg]: a mean error below is printed as 0.00, and no ratio is to it

Figures = dict[str, Any]


@dataclass(frozen=True, eq=False)
class ErrorRows:
    """R bodies after so many pushes from the first scene."""

    # what each row is of: "episode", "shape", "body", "pushed" (by the latest push),
    # "setting", "moved" [m] since the first scene, "earlier" pushes of the episode
    about: dict[str, ndarray]
    off: dict[str, Float[ndarray, "R"]]  # distances [mm] by predictor; NaN where it says nothing
    turned: dict[str, Float[ndarray, "R"]]  # likewise of headings [deg]
    # whether the latest push moved the body in prediction and truth, or in neither
    agreed: dict[str, ndarray]
    regions: dict[str, Float[ndarray, "R"]]  # radii [mm] of models that have them

    @classmethod
    def after(cls, predictions: Sequence[Predictions], step: int) -> "ErrorRows":
        """Return the rows of all windows that are as long, after so many pushes, from 1."""
        pieces = [vars(_rows_of(some, step)).values() for some in predictions]
        return cls(*(_joined(columns) for columns in zip(*pieces, strict=True)))

    def __len__(self) -> int:
        return len(self.about["episode"])

    def groups(self) -> dict[str, Mask]:
        """Return which rows are of each group; groups may share rows, and have none."""
        about = self.about
        pushed, moved = about["pushed"], about["moved"] > MOVED
        target, earlier = (about["body"] == TARGET) & ~pushed, about["earlier"]
        groups = {
            TARGETS: target,
            TARGET_MOVED: target & moved,
            TARGET_MISSED: target & ~moved,
            **{f"target, {n} earlier": target & (earlier == n) for n in range(ENOUGH)},
            f"target, {ENOUGH}+ earlier": target & (earlier >= ENOUGH),
            PUSHED: pushed,
            "all that moved": moved,
        }
        shapes = {
            f"pushed {s}": pushed & (about["shape"] == s) for s in sorted(set(about["shape"]))
        }
        names = filter(None, sorted(set(about["setting"].tolist())))
        settings = {f"in {name}": pushed & (about["setting"] == name) for name in names}
        return groups | shapes | settings

    def figures(self, name: str, rows: Mask, seed: int) -> Figures | None:
        """Return the errors of a predictor on these rows; None where it says nothing there."""
        rows = rows & np.isfinite(self.off[name])
        if not rows.any():
            return None
        off, turned = self.off[name][rows], self.turned[name][rows]
        found: Figures = {
            "number": int(rows.sum()),
            MM: self._mean(off, rows, seed),
            "median": float(np.median(off)),
            "p95": float(np.quantile(off, 0.95)),
            DEG: self._mean(turned, rows, seed),
            "agreed": float(self.agreed[name][rows].mean()),
        }
        if name in self.regions:
            held = (off <= self.regions[name][rows]).astype(float)
            found["coverage"] = self._mean(held, rows, seed)
        return found

    def _mean(self, values: Scalars, rows: ndarray, seed: int) -> Interval:
        return bootstrap_mean(values, generator(seed, "bootstrap"), self.about["episode"][rows])

    def ratio(
        self, name: str, below: str, rows: Mask, seed: int, unit: str = MM
    ) -> Interval | None:
        """Return the ratio of two mean errors; None: no values, or the one below is 0."""
        columns = self.off if unit == MM else self.turned
        above, under = columns[name], columns[below]
        rows = rows & np.isfinite(above) & np.isfinite(under)
        if not rows.any() or under[rows].mean() < LEAST:
            return None
        random, episodes = generator(seed, "ratio"), self.about["episode"][rows]
        return bootstrap_ratio(above[rows], under[rows], random, episodes)


def evaluate(
    data: Dataset,
    models: Mapping[str, Model],
    steps: Iterable[int] = (1,),
    seed: int = 0,
    others: Mapping[str, Model] | None = None,
) -> Figures:
    """Return the errors of all there is to compare; see `report` and `predictors.predict_all`.

    No model was trained on these pushes. The ratio to its own prior is of the first one. Errors are
    taken after so many pushes as `steps` has. `others` are more physics by name.
    """
    wanted = tuple(steps) or (1,)
    return report(predict_all(data, models, max(wanted), others), [*models], wanted, seed)


def report(
    predictions: Sequence[Predictions], models: Sequence[str], steps: Sequence[int], seed: int = 0
) -> Figures:
    """Return all errors as a card or a JSON report has them.

    "after" has for each number of pushes that any window reaches, "1" at least: "errors" by group
    and predictor, "ratios" of models to the best physics, to the network alone, and to the prior
    of the first model.
    """
    parts = [one.part for one in predictions]
    reached = [
        n for n in steps if any((one.windows.known.sum(axis=1) >= n).any() for one in predictions)
    ]
    found: Figures = {
        "transitions": sum(map(len, parts)),
        "episodes": len(np.unique(np.concatenate([part.episode for part in parts]))),
        "after": {},
    }
    for step in sorted({1, *reached}):
        rows = ErrorRows.after(predictions, step)
        groups = {name: chosen for name, chosen in rows.groups().items() if chosen.any()}
        errors = {
            group: {
                name: figures
                for name in rows.off
                if (figures := rows.figures(name, chosen, seed)) is not None
            }
            for group, chosen in groups.items()
        }
        ratios = {
            group: _ratios(rows, chosen, errors[group], models, seed)
            for group, chosen in groups.items()
        }
        found["after"][str(step)] = {"errors": errors, "ratios": ratios}
    return found


def _ratios(
    rows: ErrorRows, chosen: Mask, errors: Figures, models: Sequence[str], seed: int
) -> Figures:
    """Return mean errors of models over those of the best physics, LEARNED, and the own prior."""
    learned = [name for name in errors if name.startswith(tuple(models))]
    physics = [name for name in errors if name not in (*learned, *BELOW_ALL)]
    below = [min(physics, key=lambda name: errors[name][MM][0])] if physics else []
    others = (LEARNED, PRIOR, PRIOR_HISTORY)
    below += [name for name in others if name in errors and name not in below]
    found: Figures = {}
    for name in learned:
        for under in (one for one in below if one != name):
            found.setdefault(name, {})[under] = {
                unit: ratio
                for unit in (MM, DEG)
                if (ratio := rows.ratio(name, under, chosen, seed, unit)) is not None
            }
    return found


# --- of arrays ------------------------------------------------------------------------------------


def position_errors(predicted: Scenes, actual: Scenes, body: Indices | int) -> Scalars:
    """Return how far off the predicted position of a body is, or of one each (M,) [mm]."""
    return 1e3 * _ways(predicted, actual)[np.arange(len(actual)), body]


def _ways(before: Scenes, after: Scenes) -> Float[ndarray, "*B N"]:
    return np.asarray(np.linalg.norm((after - before)[..., POSITION], axis=-1))


def _rows_of(some: Predictions, step: int) -> ErrorRows:
    """Return the rows of one part."""
    windows, part = some.windows, some.part
    chosen = windows.known[:, step - 1]
    truth, shape = windows.next_scenes[chosen, step - 1], (int(chosen.sum()), part.disks)
    pushed = pushed_bodies(windows.pushes[chosen, step - 1])
    names = [one.name for one in part.bodies.fitted(part.disks).shapes]
    setting = np.full(len(part), "") if part.setting is None else part.setting

    def each(values: ndarray) -> ndarray:
        return np.broadcast_to(values, shape).reshape(-1)

    about = {
        "episode": each(windows.episodes[chosen, None]),
        "shape": each(np.array(names)),
        "setting": each(setting[windows.rows[chosen, 0], None]),
        "body": each(np.arange(part.disks)),
        "pushed": each(pushed[:, None] == np.arange(part.disks)),
        "moved": each(_ways(windows.scenes[chosen], truth)),
        "earlier": each(some.earlier[chosen, None]),
    }
    off, turned, agreed, regions = {}, {}, {}, {}

    def moves(rollouts: ndarray) -> Mask:
        """Return which bodies the latest push moved."""
        before = windows.scenes[chosen] if step == 1 else rollouts[:, step - 2]
        return (_ways(before, rollouts[:, step - 1]) > MOVED).reshape(-1)

    for name, rollouts in some.by_name.items():
        last = rollouts[chosen, step - 1]
        off[name] = 1e3 * _ways(last, truth).reshape(-1)
        headings = wrap_angle(last[..., THETA] - truth[..., THETA])
        turned[name] = np.degrees(np.abs(headings)).reshape(-1)
        agreed[name] = moves(rollouts[chosen]) == moves(windows.next_scenes[chosen])
    for name, said in some.regions.items() if step == 1 else ():
        assert said.radius is not None
        regions[name] = 1e3 * said.radius[chosen].reshape(-1)
    return ErrorRows(about, off, turned, agreed, regions)


def _joined(columns: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the same columns of all parts as one, those that a part lacks left out."""
    names = [name for name in columns[0] if all(name in some for some in columns)]
    return {name: np.concatenate([some[name] for some in columns]) for name in names}
