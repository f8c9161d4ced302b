"""Fits the regions of `sain_model.dynamics.intervals` to episodes that no weight was fitted to."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.optimize import minimize

from sain_core.push import pushed_bodies
from sain_core.scene import POSITION, RADIUS, THETA, wrap_angle
from sain_core.types import Scalars
from sain_model.data.dataset import Dataset, Part
from sain_model.dynamics.identify import body_names, states_bodies
from sain_model.dynamics.intervals import LEVEL, Intervals, Prediction, Region
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.errors import predict_with_history
from sain_model.network.features import elongations

RESOLUTION: Final = 1e-6  # [m], differences below this do not count
WINDOWS: Final = 7  # that the validation pushes are looked at in, in the order of their scores
WINDOW_SHARE: Final = 1 / 3  # of the pushes in each of the overlapping windows
FEW: Final = 60  # pushes below which there is one window
FEW_BODIES: Final = 4  # fewer do not show how far bodies differ
STARTS: Final = (0.0, -2.0, -4.0)  # of the search, logarithms of the weights


def fit_intervals(sain: SainDynamics, *data: Part) -> Intervals:
    """Return regions that hold the pushed body and others in a share `LEVEL` of the pushes.

    The model's weights were not fitted to this data. Friction is told as in deployment, by the
    episode's earlier pushes.
    """
    return fit_regions([predict_with_history(sain, part) for part in data], data)


def fit_regions(
    predictions: Sequence[Prediction],
    data: Sequence[Part],
    level: float = LEVEL,
) -> Intervals:
    """Return regions that hold bodies in a share `level` of predicted pushes."""
    pieces = [_scored(*piece) for piece in zip(predictions, data, strict=True)]
    configs = []
    for rows in range(3):  # places of pushed bodies and of others, turns
        parts, off, long = (
            np.concatenate([piece[rows][column] for piece in pieces], axis=-1)
            for column in range(3)
        )
        fitted = off.max(initial=0.0) > RESOLUTION
        configs.append(fit_disk(parts, off, long, level) if fitted else None)
    mid, target, turn = configs
    mid = mid or Region()
    # Where scenes have one body, there are no others: theirs would be as the pushed one's.
    intervals = Intervals(level, mid, target or mid, turn or Region())
    intervals = replace(intervals, usual_log_std=(0.0, 0.0 if turn is None else 1.0))
    return _with_default_errors(intervals, predictions, data)


def _with_default_errors(
    intervals: Intervals, predictions: Sequence[Prediction], data: Sequence[Part]
) -> Intervals:
    """Return intervals with the usual logarithms of error over region of pushed bodies.

    Where the data name bodies, the spread is divided into that between and that within them.
    """
    each = []
    for prediction, part in zip(predictions, data, strict=True):
        each.append(intervals.excess(with_regions(intervals, prediction, part), part))
    logs = np.concatenate(each, axis=1)
    between = np.zeros(2)
    if states_bodies(Dataset(tuple(data))):
        between = _between(logs, np.concatenate([body_names(part) for part in data]))
    mean, within = logs.mean(axis=1), np.sqrt(np.maximum(logs.var(axis=1) - between**2, 0.0))
    turns = float(intervals.usual_log_std[1] > 0.0)  # 0: headings have no regions
    usual, std, bodies = (
        (float(places), turns * float(headings)) for places, headings in (mean, within, between)
    )
    return replace(intervals, usual_log=usual, usual_log_std=std, bodies_log_std=bodies)


def with_regions(intervals: Intervals, prediction: Prediction, data: Part) -> Prediction:
    """Return a prediction of data with its regions."""
    return intervals.about(prediction, data.state, pushed_bodies(data.action), _long(data))


def _between(logs: Float[ndarray, "2 M"], bodies: ndarray) -> Float[ndarray, "2"]:
    """Return the standard deviation between the means of bodies, less what chance makes of it."""
    place = np.unique(bodies, return_inverse=True)[1]
    counts = np.bincount(place)
    if len(counts) < FEW_BODIES:
        return np.zeros(2)
    means = np.stack([np.bincount(place, row) / counts for row in logs])
    left = ((logs - means[:, place]) ** 2).sum(axis=1) / max(len(place) - len(counts), 1)
    chance = left * (1.0 / counts).mean()
    return np.asarray(np.sqrt(np.maximum(means.var(axis=1, ddof=1) - chance, 0.0)))


def _long(data: Part) -> Float[ndarray, "N"]:
    return elongations(data.bodies.fitted(data.disks))


def _scored(
    prediction: Prediction, data: Part
) -> list[tuple[Float[ndarray, "3 R"], Float[ndarray, "R"], Float[ndarray, "R"]]]:
    """Return parts of the score, distances and elongations.

    First those of the pushed bodies, then those of the others to look at, then the turns of the
    pushed ones as ways at their radius.
    """
    missing = prediction.mean - data.next_state
    way = np.linalg.norm((prediction.mean - data.state)[..., POSITION], axis=-1)
    off = np.linalg.norm(missing[..., POSITION], axis=-1)
    arcs = np.abs(wrap_angle(missing[..., THETA])) * data.state[..., RADIUS]
    parts = np.stack([prediction.members, prediction.friction, way])  # (3, M, N)
    long = np.broadcast_to(_long(data), off.shape)
    pushed = pushed_bodies(data.action)[:, None] == np.arange(data.disks)
    scored = (pushed, off), (~pushed, off), (pushed, arcs)
    return [(parts[:, rows], values[rows], long[rows]) for rows, values in scored]


def fit_disk(parts: Float[ndarray, "3 M"], off: Scalars, long: Scalars, level: float) -> Region:
    """Fit one disk's radius to distances (M,) [m] of bodies with elongations (M,)."""
    region = _fit_score(parts, off, long, level)
    scores, factors = _factors(region.score(parts[0], parts[1], parts[2], long), off, level)
    return replace(region, scores=scores, factors=factors)


def _fit_score(parts: Float[ndarray, "3 M"], off: Scalars, long: Scalars, level: float) -> Region:
    """Return weights so that the score is, as near as can be, the level's quantile.

    That is quantile regression of the logarithm of the distance.
    """
    varies = parts.max(axis=1) > RESOLUTION
    logs, some = np.log(off + RESOLUTION), parts[varies]

    def loss(parameters: Float[ndarray, "Q"]) -> float:
        values = np.exp(np.clip(parameters[: len(some) + 1], -20.0, 10.0))
        missing = logs - np.log(RESOLUTION + values[0] + values[1:] @ some)
        missing -= parameters[-1] * long
        pinball = np.maximum(level * missing, (level - 1.0) * missing).mean()
        return float(pinball + 1e-6 * np.square(parameters).sum())

    found = []
    for start in STARTS:
        first = np.array([np.log(1e-4), *[start] * len(some), 0.0])
        rough = minimize(loss, first, method="Powell")
        found.append(minimize(loss, rough.x, method="Nelder-Mead"))
    lowest = min(found, key=lambda result: result.fun).x
    best, weights = np.exp(np.clip(lowest[: len(some) + 1], -20.0, 10.0)), np.zeros(3)
    weights[varies] = best[1:]
    members, friction, way = weights.tolist()
    return Region(float(best[0] + RESOLUTION), members, friction, way, float(lowest[-1]))


def _factors(
    scores: Scalars, off: Scalars, level: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return in how many scores this share of the distances lies, where scores are alike."""
    order = np.argsort(scores, kind="stable")
    alone = len(order) < FEW
    size = len(order) if alone else round(WINDOW_SHARE * len(order))
    places: list[float] = []
    factors: list[float] = []
    for first in np.linspace(0, len(order) - size, 1 if alone else WINDOWS).round().astype(int):
        rows = order[first : first + size]
        place = float(np.exp(np.median(np.log(scores[rows]))))
        if not places or place > places[-1]:
            places.append(place)
            factors.append(_quantile(off[rows] / scores[rows], level))
    return tuple(places), tuple(factors)


def _quantile(values: Scalars, level: float) -> float:
    """Return what the next value of this kind is below with this probability (split conformal)."""
    rank = min(level * (len(values) + 1) / len(values), 1.0)
    return max(float(np.quantile(values, rank, method="inverted_cdf")), 1e-3)
