"""Fits the regions of `sain_model.dynamics.intervals` to episodes that no weight was fitted to."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.optimize import minimize

from sain_core.push import pushed_bodies
from sain_core.scene import POSITION, RADIUS, THETA, wrap_angle
from sain_core.types import Scalars
from sain_model.data.dataset import Part
from sain_model.dynamics.intervals import COUNTS, LEVEL, Intervals, Law, Prediction, Region, ratios
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.errors import predict_with_history
from sain_model.inference.evidence import Known
from sain_model.network.features import elongations

RESOLUTION: Final = 1e-6  # [m], differences below this do not count
WINDOWS: Final = 7  # that the validation pushes are looked at in, in the order of their scores
WINDOW_SHARE: Final = 1 / 3  # of the pushes in each of the overlapping windows
FEW: Final = 60  # pushes below which there is one window
FEW_FIRST: Final = 20  # episodes of a world, likewise for their first pushes
SLACK: Final = 0.03  # by which the share of a world may be smaller than that of all together
FIRST: Final = (0.5, 1.5, 5.0, 0.3)  # size, dimensions, tail and spread of bodies: of the search,
LOWEST: Final = (0.01, 0.3, 1.5, 0.05)  # and their limits
HIGHEST: Final = (10.0, 4.0, 50.0, 3.0)
STARTS: Final = (0.0, -2.0, -4.0)  # of the search, logarithms of the weights


def fit_intervals(sain: SainDynamics, *data: Part) -> Intervals:
    """Return regions that hold the pushed body and others in a share `LEVEL` of the pushes.

    The model's weights were not fitted to this data. Friction is told as in deployment, by the
    episode's earlier pushes.
    """
    episodes, steps = (
        np.concatenate([getattr(part, name) for part in data]) for name in ("episode", "step")
    )
    predictions = [predict_with_history(sain, part) for part in data]
    return fit_regions(predictions, data, Known.earlier(episodes, steps))


def fit_regions(
    predictions: Sequence[Prediction], data: Sequence[Part], known: Known, level: float = LEVEL
) -> Intervals:
    """Return regions that hold bodies in a share `level` of predicted pushes.

    `known` are, of all parts together, the pushes whose errors the region of each push follows, as
    in use: of a body, or of an episode. No push is among its own.
    """
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
    intervals = Intervals(level, mid, target or mid, turn or Region(), headings=Law(size=1.0))
    about = [with_regions(intervals, *piece) for piece in zip(predictions, data, strict=True)]
    each = [list(ratios(*piece)) for piece in zip(about, data, strict=True)]
    settings = np.concatenate([_settings(part) for part in data])
    places, headings = (
        fit_law(np.concatenate(some), known, settings, level) for some in zip(*each, strict=True)
    )
    return replace(intervals, places=places, headings=headings if turn else Law())


def fit_law(ratio: Scalars, known: Known, settings: ndarray, level: float) -> Law:
    """Return the law of errors over regions (M,) in worlds with these names (M,).

    It gives each error the highest density on average, given the known ones. Quantiles are split
    conformal: a share `level` of the errors is below. In each world it is at most `SLACK` less,
    and no less where no error is known, as nothing shows which world it is.
    """

    def law(parameters: Float[ndarray, "4"]) -> Law:
        values = np.exp(np.clip(parameters, np.log(LOWEST), np.log(HIGHEST)))
        return Law(*values.tolist())

    def loss(parameters: Float[ndarray, "4"]) -> float:
        one = law(parameters)
        curves = one.curves(ratio)
        mean = (one.posterior(known.total(curves)) * np.exp(curves)).sum(axis=1)
        return float(-np.log(np.maximum(mean, 1e-12)).mean())

    found = law(minimize(loss, np.log(FIRST), method="Nelder-Mead", options={"xatol": 0.01}).x)
    below = (found.posterior(known.total(found.curves(ratio))) * found.below(ratio)).sum(axis=1)
    levels: list[float] = []
    names = np.unique(settings)
    for low, high in pairwise((*COUNTS, np.inf)):
        now = (low <= known.counts) & (known.counts < high)
        few, least = (FEW, level - SLACK) if low else (FEW_FIRST, level)
        worlds = [now & (settings == name) for name in names]
        each = [_quantile(below[rows], least) for rows in worlds if rows.sum() >= few]
        each += [_quantile(below[now], level)] if now.sum() >= FEW else []
        levels.append(max(each or [_quantile(below, level), *levels[1:]][-1:]))
    return replace(found, levels=tuple(levels))


def _settings(part: Part) -> ndarray:
    return np.full(len(part), "") if part.setting is None else part.setting


def with_regions(intervals: Intervals, prediction: Prediction, data: Part) -> Prediction:
    """Return a prediction of data with its regions."""
    return intervals.about(prediction, data.state, pushed_bodies(data.action), _long(data))


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
