"""What pushes say about the physics: its kind and its parameters.

Of each kind of physics, the parameters that have a grid are inferred on it, the others stay as
believed. About the kind with the greatest evidence, all parameters are inferred together, by
damped Gauss-Newton (Levenberg, Marquardt) with Student's t. What has the greatest evidence
predicts. In an episode there is one step after each push (`Trace`). A `fit` is of whole episodes,
side by side.
"""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from hashlib import sha256
from typing import Final, Self

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from sain_core.push import pushed_bodies
from sain_core.shapes.bodies import Bodies
from sain_core.types import Indices, Mask, Pushes, Scalars, Scenes
from sain_model.inference.evidence import (
    FACTORS,
    Known,
    ObservedPushes,
    curves_of,
    errors_of,
    log_density,
    marginals,
    over_factors,
    weights_of,
)
from sain_model.inference.kinds import SHARED, Belief, Kind, Places

DIFFERENCE: Final = 0.2  # [spreads], of a finite difference
LONGEST: Final = 1.5  # [spreads], of a step
DAMPING: Final = np.array([0.0, 0.1, 1.0, 10.0, 100.0])  # of steps, shares of the diagonal
ENOUGH: Final = 0.05  # a smaller gain of the logarithm of the posterior density is the last
# Of the noise: many pushes fitted closely are worth less than all fitted. Tempered ones may be.
LEAST_FACTOR: Final = 1.0

Parts = Sequence[ObservedPushes]


@dataclass(frozen=True, eq=False)
class Fit:
    """The most likely parameters of C episodes, each by itself."""

    kind: Kind  # of physics that the vectors z are about
    places: Float[ndarray, "C D"]  # z of each episode
    normal: "Normal"  # the normal equations there, for the noise of `factor`
    factor: Float[ndarray, "C"]  # of the noise
    log_evidence: Float[ndarray, "C"]  # by Laplace's approximation


@dataclass(frozen=True, eq=False)
class Normal:
    """What pushes add to the normal equations of each of C episodes."""

    information: Float[ndarray, "C D D"]
    pull: Float[ndarray, "C D"]

    def add(
        self,
        kind: Kind,
        part: ObservedPushes,
        factor: Float[ndarray, "C"],
        errors: Float[ndarray, "P N 3"],
        slopes: Float[ndarray, "P N 3 D"],
    ) -> None:
        """Add what pushes with these errors show, which change so with the parameters."""
        scale = part.scales(factor[part.episode, None])
        weight = weights_of(errors, scale[..., None])[..., 0]  # (P, N)
        errors, slopes = errors / scale[..., None], slopes / scale[..., None, None]
        weighted = kind.temper * weight[..., None, None] * slopes
        np.add.at(self.information, part.episode, np.einsum("pnid,pnie->pde", weighted, slopes))
        np.add.at(self.pull, part.episode, np.einsum("pnid,pni->pd", weighted, errors))


def fit(kind: Kind, parts: Parts, start: Float[ndarray, "C D"], steps: int) -> Fit:
    """Return the most likely parameters of each episode, after so many steps at most.

    Each of the C episodes that `parts` count has a first vector z.
    """
    places, totals = start.copy(), _totals(kind, parts, start)
    damping, goes_on = np.zeros(len(totals), np.int64), np.ones(len(totals), dtype=bool)
    for _ in range(steps):
        score, factor = _best(kind, totals)
        normal = normal_equations(kind, _of_episodes(parts, goes_on), places, factor)
        _climb(kind, parts, normal, places, totals, damping, goes_on)
        goes_on = _best(kind, totals)[0] > score + ENOUGH
        if not goes_on.any():
            break
    _, factor = _best(kind, totals)
    normal = normal_equations(kind, parts, places, factor)
    return Fit(kind, places, normal, factor, _log_evidence(kind, totals, normal, factor))


def _climb(
    kind: Kind,
    parts: Parts,
    normal: Normal,
    places: Float[ndarray, "C D"],
    totals: Float[ndarray, "C K"],
    damping: Int[ndarray, "C"],
    climbs: Bool[ndarray, "C"],
) -> None:
    """Move places of episodes that climb by a step, in place, damped until totals are larger."""
    score, tried = _best(kind, totals)[0], climbs
    while tried.any():
        moved = places + tried[:, None] * _step(normal, kind, places, DAMPING[damping])
        now = _totals(kind, _of_episodes(parts, tried), moved)
        better = tried & (_best(kind, now)[0] > score)
        totals[better], places[better] = now[better], moved[better]
        tried = tried & ~better & (damping < len(DAMPING) - 1)
        damping[tried] += 1
        damping[better] = np.maximum(damping[better] - 1, 0)


def _log_evidence(
    kind: Kind, totals: Float[ndarray, "C K"], normal: Normal, factor: Float[ndarray, "C"]
) -> Float[ndarray, "C"]:
    """Return the logarithm of the evidence of each episode by Laplace's approximation."""
    share = (factor[:, None] / FACTORS)[..., None, None] ** 2
    after = np.linalg.slogdet(normal.information[:, None] * share + kind.precision)[1]  # (C, K)
    room = after - np.linalg.slogdet(kind.precision)[1]
    return over_factors(totals - 0.5 * room)


def normal_equations(
    kind: Kind, parts: Parts, places: Float[ndarray, "C D"], factor: Float[ndarray, "C"]
) -> Normal:
    """Return the normal equations of each episode at vectors z, with a factor of the noise each."""
    count, size = places.shape
    normal = Normal(np.zeros((count, size, size)), np.zeros((count, size)))
    for part in parts:
        normal.add(kind, part, factor, *slopes_of(kind, part, places[part.episode]))
    return normal


def slopes_of(
    kind: Kind, pushes: ObservedPushes, places: Places
) -> tuple[Float[ndarray, "P N 3"], Float[ndarray, "P N 3 D"]]:
    """Return errors, and how they change with each parameter.

    Where a parameter is at its largest value, the difference is to a smaller one. Those of a body
    that a push does not move change nothing.
    """
    after = after_at(kind, pushes, places)
    errors = errors_of(after, pushes.next_state)
    step = np.where(kind.at_most(places + DIFFERENCE), -DIFFERENCE, DIFFERENCE)  # (P, D)
    counts = np.ones(step.shape, dtype=bool)
    if kind.body:
        moves = (after != pushes.state).any(axis=-1)
        moves[np.arange(len(moves)), pushed_bodies(pushes.action)] = True
        moves[:, list(pushes.bodies.fitted(pushes.disks).fixed)] = True
        there = np.pad(moves, ((0, 0), (0, kind.bodies - moves.shape[1])))
        counts = np.where(np.equal(kind.body, SHARED), True, there[:, kind.body])
    rows, columns = np.nonzero(counts)
    many = places[rows]
    many[np.arange(len(rows)), columns] += step[rows, columns]
    apart = errors_at(kind, pushes, many, rows) - errors[rows]
    slopes = np.zeros((*step.shape, *errors.shape[1:]))
    slopes[rows, columns] = apart / step[rows, columns, None, None]
    return errors, np.moveaxis(slopes, 1, -1)


def errors_at(
    kind: Kind, pushes: ObservedPushes, places: Places, rows: Indices | slice = slice(None)
) -> Float[ndarray, "P N 3"]:
    """Return errors [m] of predictions of these rows, each with parameters z of its own (P, D)."""
    return errors_of(after_at(kind, pushes, places, rows), pushes.next_state[rows])


def after_at(
    kind: Kind, pushes: ObservedPushes, places: Places, rows: Indices | slice = slice(None)
) -> Scenes:
    """Return predictions of these rows, each with parameters z of its own (P, D)."""
    values = kind.values(places) | pushes.given_at(rows)
    return kind.step(pushes.bodies, pushes.state[rows], pushes.action[rows], values)


def _totals(kind: Kind, parts: Parts, places: Float[ndarray, "C D"]) -> Float[ndarray, "C K"]:
    """Return the logarithm of the posterior density of each episode for each factor."""
    far = np.einsum("cd,de,ce->c", places, kind.precision, places)
    total = np.repeat(-0.5 * far[:, None], len(FACTORS), axis=1)
    for part in parts:
        densities = log_density(errors_at(kind, part, places[part.episode]), part.scales(FACTORS))
        np.add.at(total, part.episode, kind.temper * densities)
    return total


def _best(
    kind: Kind, totals: Float[ndarray, "C K"]
) -> tuple[Float[ndarray, "C"], Float[ndarray, "C"]]:
    """Return the largest total of each episode among factors that count, and its factor."""
    counts = LEAST_FACTOR * (kind.temper == 1.0) <= FACTORS
    return totals[:, counts].max(axis=1), FACTORS[counts][totals[:, counts].argmax(axis=1)]


def _step(
    normal: Normal, kind: Kind, places: Float[ndarray, "C D"], damping: Float[ndarray, "C"]
) -> Float[ndarray, "C D"]:
    """Return the change of the parameters of each episode, none too long.

    `damping` is added to the diagonals of its normal equations, as a share of them.
    """
    full = normal.information + kind.precision
    full = full + damping[:, None, None] * full * np.eye(full.shape[-1])
    pull = normal.pull + places @ kind.precision
    step = -np.linalg.solve(full, pull[..., None])[..., 0]
    longest = np.abs(step).max(axis=1, keepdims=True, initial=0.0)
    return np.asarray(step * (LONGEST / np.maximum(longest, LONGEST)))


def _of_episodes(parts: Parts, chosen: Mask) -> Parts:
    """Return the pushes of some episodes."""
    return parts if chosen.all() else [part.select(chosen[part.episode]) for part in parts]


# --- one push after the other ---------------------------------------------------------------------

SLOPES: Final = 8  # pushes whose slopes are computed anew after each push
MOVED: Final = 0.05  # [spreads], of parameters, after which slopes are others
UNCERTAIN: Final = 3  # first pushes: there the grid may have the better start
GROWING: Final = [int(4 * 1.1**power) for power in range(100)]
# Numbers of pushes that later steps start from: a step may take several pushes of a long history.
COUNTS: Final = sorted({*range(1, 33), *GROWING})
ANEW: Final = frozenset(GROWING[::4])  # there a fit from the grid is tried: a body may have changed
STEPS: Final = 3  # of such a fit
CHANGED: Final = float(np.log(0.05))  # of the probability that a body or a table changes
LATEST: Final = 8  # pushes, of which two may show a change
KEPT: Final = 96  # latest histories: of 500 pushes of two bodies, 48 MB


@dataclass(frozen=True, eq=False)
class Trace:
    """The most likely parameters of an episode after its first P pushes.

    There is one step from those of the largest smaller number of `COUNTS`. Slopes of a push that
    was seen long ago stay as they were, unless the parameters have moved the most since then.
    """

    place: Float[ndarray, "D"]  # the vector z
    slopes: Float[ndarray, "P N 3 D"]
    at: Float[ndarray, "P D"]  # vectors z at which they were computed
    covariance: Float[ndarray, "D D"]
    log_evidence: float
    first: int = 0  # pushes that do not count: later ones contradict them
    earlier: float = 0.0  # logarithm of their evidence, which is part of that of all

    @classmethod
    def before(cls, kind: Kind, bodies: int) -> Self:
        """Return what is believed before any push of so many bodies."""
        size = len(kind.names)
        slopes = np.empty((0, bodies, 3, size))
        return cls(np.zeros(size), slopes, np.empty((0, size)), kind.covariance, 0.0)

    def then(self, kind: Kind, pushes: ObservedPushes, curves: Float[ndarray, "P G K"]) -> Self:
        """Return what is believed after all of these pushes, of which the first are known.

        `curves` are those of a grid. Where nothing that was known explains the latest pushes
        better, the body or the table may have changed: if the evidence says so, the pushes before
        do not count any more.
        """
        found = self._grown(kind, pushes.select(slice(self.first, None)), curves[self.first :])
        first = len(pushes) - self._unexplained(kind, pushes)
        if first in (self.first, len(pushes)):
            return found
        latest = pushes.select(slice(first, None))
        anew = replace(self.before(kind, pushes.disks), first=first)
        anew = anew._grown(kind, latest, curves[first:])
        explained = float(over_factors(_densities_at(kind, latest, found.place).sum(axis=0)))
        changed = kind.temper * CHANGED
        if anew.log_evidence + changed < explained:
            return found
        earlier = found.log_evidence - explained + changed
        return replace(anew, log_evidence=earlier + anew.log_evidence, earlier=earlier)

    def _unexplained(self, kind: Kind, pushes: ObservedPushes) -> int:
        """Return how many of the latest pushes are more likely if nothing is known: 0, or 2 on."""
        latest = pushes.select(slice(max(self.first, len(pushes) - LATEST), None))
        usual, here = (
            over_factors(_densities_at(kind, latest, place))
            for place in (np.zeros_like(self.place), self.place)
        )
        lead = np.cumsum((usual - here)[::-1])
        return int(lead.argmax()) + 1 if lead[1:].max(initial=0.0) > max(lead[0], 0.0) else 0

    def _grown(self, kind: Kind, pushes: ObservedPushes, curves: Float[ndarray, "P G K"]) -> Self:
        """Return what is believed after all pushes that count."""
        start = marginals(kind, curves.sum(axis=0)[None]).places[0]
        places, parts, nothing = self.place[None].copy(), [pushes], np.zeros(1, np.int64)
        totals, other = _totals(kind, parts, places), None
        new = len(pushes) - len(self.at)
        renewed = new + SLOPES - 1
        if len(pushes) <= UNCERTAIN:
            on_grid = np.array([name in kind.on_grid for name in kind.names])
            other = np.where(on_grid, start, self.place)[None]
        elif len(pushes) in ANEW:
            other, renewed = fit(kind, parts, start[None], STEPS).places, len(pushes)
        if other is not None:
            there = _totals(kind, parts, other)
            if _best(kind, there)[0] > _best(kind, totals)[0]:
                places, totals = other, there
        slopes = np.concatenate([self.slopes, np.zeros((new, *self.slopes.shape[1:]))])
        at = np.concatenate([self.at, np.full((new, len(self.place)), np.inf)])
        far = np.abs(at - places).max(axis=1)
        anew = np.argsort(-far, kind="stable")[:renewed]
        anew = anew[far[anew] > MOVED]
        slopes[anew] = slopes_of(kind, pushes.select(anew), np.repeat(places, len(anew), axis=0))[1]
        at[anew] = places
        normal = _normal(kind, pushes, places, slopes, totals)
        _climb(kind, parts, normal, places, totals, nothing, nothing == 0)
        normal = _normal(kind, pushes, places, slopes, totals)
        evidence = _log_evidence(kind, totals, normal, _best(kind, totals)[1])
        covariance = np.linalg.inv(normal.information[0] + kind.precision)
        log_evidence = self.earlier + float(evidence[0])
        return type(self)(places[0], slopes, at, covariance, log_evidence, self.first, self.earlier)


def _densities_at(
    kind: Kind, pushes: ObservedPushes, place: Float[ndarray, "D"]
) -> Float[ndarray, "P K"]:
    """Return the logarithm of the density of each push at a vector z, for each factor."""
    errors = errors_at(kind, pushes, np.repeat(place[None], len(pushes), axis=0))
    return kind.temper * log_density(errors, pushes.scales(FACTORS))


def _normal(
    kind: Kind, pushes: ObservedPushes, places: ndarray, slopes: ndarray, totals: ndarray
) -> Normal:
    size = places.shape[1]
    normal = Normal(np.zeros((1, size, size)), np.zeros((1, size)))
    errors = errors_at(kind, pushes, np.repeat(places, len(pushes), axis=0))
    normal.add(kind, pushes, _best(kind, totals)[1], errors, slopes)
    return normal


def traces(kind: Kind, pushes: ObservedPushes, known: Known) -> list[Trace]:
    """Return what is believed after the pushes of each row, in their order.

    A row goes on where a shorter one ends, and an episode where it was before its latest push.
    """
    pushes = replace(pushes, episode=np.zeros(len(pushes), np.int64))
    curves, rows = curves_of(kind, pushes), np.split(known.push, np.cumsum(known.counts)[:-1])
    before, chain = Trace.before(kind, pushes.disks), list[tuple[Indices, Trace]]()
    few = len(rows) <= KEPT // 2
    found = [before] * len(rows)
    for number in sorted(range(len(rows)), key=lambda row: rows[row].tolist()):
        row = rows[number]
        steps = [row[:count] for count in (*COUNTS[: bisect_left(COUNTS, len(row))], len(row))]
        while chain and not any(np.array_equal(chain[-1][0], some) for some in steps):
            chain.pop()
        for some in steps[:-3:-1] if few else ():
            if chain and len(some) <= len(chain[-1][0]):
                break
            if kept := _place_of(kind, pushes.bodies, _key(pushes, some)):
                chain.append((some, kept[0]))
                break
        for some in steps[sum(len(some) <= len(chain[-1][0]) for some in steps) if chain else 0 :]:
            last = chain[-1][1] if chain else before
            chain.append((some, last.then(kind, pushes.select(some), curves[some])))
        found[number] = chain[-1][1]
    latest = chain[-2:] if len(rows) == 1 else zip(rows, found, strict=True) if few else ()
    for some, trace in latest:
        _place_of(kind, pushes.bodies, _key(pushes, some))[:] = [trace]
    return found


def _key(pushes: ObservedPushes, rows: Indices) -> bytes:
    text = repr((len(rows), pushes.disks, pushes.noise is None, list(pushes.given or ()))).encode()
    return sha256(text + b"".join(column[rows].tobytes() for column in pushes.seen)).digest()


@lru_cache(KEPT)
def _place_of(kind: Kind, bodies: Bodies, pushes: bytes) -> list[Trace]:
    """Return where the trace of an episode is kept, for the next push."""
    return []


# --- rows of pushes -------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Posterior:
    """What each of R rows says about the kinds of a belief."""

    belief: Belief
    kind: Int[ndarray, "R"]  # number of the most likely one
    # whether all parameters are inferred; else those of the grid alone
    inferred: Bool[ndarray, "R"]
    places: Places  # vectors z of that kind; 0 beyond its own parameters
    spreads: Places  # standard deviations of z
    corrected: Bool[ndarray, "R"]  # whether the network corrects it
    first: Int[ndarray, "R"]  # pushes of the row that do not count: later ones contradict them
    memories: ndarray  # (R,) of `sain_model.dynamics.memory.Memory`, or None: no errors are known

    @classmethod
    def at(cls, belief: Belief, kind: int, places: Places, corrected: Bool[ndarray, "R"]) -> Self:
        """Return rows with one kind of physics at vectors z (R, D)."""
        nothing = np.zeros(len(places), np.int64)
        memories, spreads = np.full(len(places), None), np.zeros_like(places)
        kinds, inferred = nothing + kind, nothing > 0
        return cls(belief, kinds, inferred, places, spreads, corrected, nothing, memories)

    def of_rows(self, rows: Int[ndarray, "C"] | slice) -> Self:
        """Return some rows, any of them as often as its number is given."""
        arrays = {name: some[rows] for name, some in vars(self).items() if name != "belief"}
        return replace(self, **arrays)

    @property
    def by_kind(self) -> list[tuple[Int[ndarray, "C"], Kind]]:
        """The rows of each kind that has any."""
        return _of_kinds(self.belief, self.kind)

    def moved(self, name: str, deviations: float) -> Self:
        """Return the rows with a parameter so many of its standard deviations away."""
        places = self.places.copy()
        for rows, kind in self.by_kind:
            if name in kind.names:
                column = kind.names.index(name)
                places[rows, column] += deviations * self.spreads[rows, column]
        return replace(self, places=places)

    def values(self, name: str) -> ndarray:
        """Return the value of a parameter (R,), or (R, N) of each body."""
        bodies = max(kind.names.count(name) for kind in self.belief.kinds)
        found = np.empty((len(self.kind), max(bodies, 1)))
        for rows, kind in self.by_kind:
            value = np.asarray(kind.value(name, self.places[rows]))
            found[rows] = value[:, None] if value.ndim == 1 else value
        return found if bodies > 1 else found[:, 0]

    def log_spread(self, name: str) -> Scalars:
        """Return the spread (R,) of a parameter: of its logarithm, if it is a factor."""
        found = np.zeros(len(self.kind))
        for rows, kind in self.by_kind:
            if name in kind.names:
                column = kind.names.index(name)
                found[rows] = kind.parameters[column].spread * self.spreads[rows, column]
        return found

    def believed(self) -> dict[str, ndarray]:
        """Return the values (R,), or (R, N), of all parameters that pushes show, by name.

        Where a parameter is none of a row's kind, it has the value of that kind's prior.
        """
        names = dict.fromkeys(name for kind in self.belief.kinds for name in kind.names)
        return {name: self.values(name) for name in names}

    def step(self, bodies: Bodies, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Predict push i (M, N, 8) with the physics of row i."""
        predicted = np.empty_like(scenes)
        for rows, kind in self.by_kind:
            values = kind.values(self.places[rows])
            predicted[rows] = kind.step(bodies, scenes[rows], pushes[rows], values)
        return predicted


def infer(belief: Belief, pushes: ObservedPushes, known: Known) -> Posterior:
    """Return what each row of known pushes says of the physics, with the belief before them."""
    belief = belief.of_scene(pushes.disks if len(pushes) else 1)
    width, rows = max(len(kind.names) for kind in belief.kinds), np.arange(known.rows)
    alone = [marginals(kind, known.total(_curves(kind, pushes))) for kind in belief.kinds]
    odds = np.array([kind.log_odds_of(pushes.bodies) for kind in belief.kinds])
    log_evidence = np.stack([one.log_evidence for one in alone], axis=1) + odds
    best = log_evidence.argmax(axis=1)
    places, spreads = (
        np.stack([np.pad(p, ((0, 0), (0, width - p.shape[1]))) for p in parts], axis=1)[rows, best]
        for parts in ([one.places for one in alone], [one.spreads for one in alone])
    )
    inferred, first = np.zeros(known.rows, dtype=bool), np.zeros(known.rows, np.int64)
    for chosen, kind in _of_kinds(belief, best):
        some = chosen[known.counts[chosen] > 0]
        if not len(some) or len(kind.on_grid) == len(kind.names):
            continue
        found = traces(kind, pushes, known.of_rows(some))
        together = np.array([one.log_evidence for one in found]) + kind.log_odds_of(pushes.bodies)
        better = (together > log_evidence[some, best[some]]) | kind.of_bodies
        inferred[some] = better
        for row, one in zip(some[better], (found[i] for i in np.flatnonzero(better)), strict=True):
            places[row, : len(kind.names)], first[row] = one.place, one.first
            spreads[row, : len(kind.names)] = np.sqrt(np.diag(one.covariance))
    memories = np.full(known.rows, None)
    return Posterior(belief, best, inferred, places, spreads, inferred, first, memories)


def _of_kinds(belief: Belief, numbers: Int[ndarray, "R"]) -> list[tuple[Int[ndarray, "C"], Kind]]:
    """Return the rows of each kind that has any."""
    found = [(np.flatnonzero(numbers == number), kind) for number, kind in enumerate(belief.kinds)]
    return [(rows, kind) for rows, kind in found if len(rows)]


def _curves(kind: Kind, pushes: ObservedPushes) -> Float[ndarray, "M G K"]:
    """Return how well places of a grid explain pushes; nothing of what cannot be is computed."""
    if kind.log_odds_of(pushes.bodies) == -np.inf:
        return np.zeros((len(pushes), len(kind.grid), len(FACTORS)))
    return curves_of(kind, pushes)
