"""What is believed of the physics of a laboratory: the one inference, from the latest pushes.

A window of pushes is fitted anew when an episode has ended, from the values found before: few steps
are enough. So cost and memory stay flat, and what is old is forgotten. Two kinds of physics
compete. The one with the larger evidence predicts; the other is fitted when the pushes have grown
by half.

All shared parameters are known then: an episode's own pushes show its friction alone. That is as
accurate as to infer all of them again, and takes a tenth of the time.

What is believed of bodies that have names, each on its surface, as a robot's recordings state.

Each body has values of its own of every parameter; see `sain_model.inference.population`.
"""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.shapes.bodies import Bodies
from sain_lab.storage.results import Result, history_of
from sain_model.dynamics import identify
from sain_model.dynamics.sain import PHYSICS, Origin, SainDynamics
from sain_model.inference.evidence import ObservedPushes
from sain_model.inference.kinds import (
    FRICTION,
    Belief,
    Kind,
    laboratory_kinds,
    surface_kind,
)
from sain_model.inference.population import Pair, Population
from sain_model.inference.posterior import Fit
from sain_model.physics.planar import PlanarPrior

WINDOW: Final = 300  # pushes that the belief is inferred from
FEWEST: Final = 5  # pushes that a belief is inferred from
AGAIN: Final = 10  # most steps of a fit that starts from the one before
LATEST: Final = 3  # likewise of a fit to the latest pushes alone
ENOUGH: Final = 0.05  # share of new pushes after which it is inferred again
GROWTH: Final = 1.5  # of the pushes, after which all kinds are compared again
RULED_OUT: Final = -10.0  # logarithm of the odds of kinds that do not predict
FEW: Final = 6  # episodes that show how much theirs differ
JUMPS: Final = 3.0  # logarithm of the odds, beforehand, that no episode differs from those before
WIDE: Final = 0.5  # spread of what a changed table may have become

Values = Mapping[str, float]
Parameters = dict[str, tuple[float, float]]  # values and spreads by name


def observed(results: Iterable[Result]) -> tuple[list[ObservedPushes], list[str]]:
    """Return pushes for inference, those of the same bodies together, and names of the episodes."""
    groups: dict[tuple[Bodies, int], list[tuple[Result, int]]] = {}
    numbers: dict[str, int] = {}
    for one in results:
        number = numbers.setdefault(one.episode or one.identity, len(numbers))
        groups.setdefault((one.own_bodies, len(one.push)), []).append((one, number))
    parts = [_joined(bodies, some) for (bodies, _), some in groups.items()]
    return parts, list(numbers)


def _joined(bodies: Bodies, some: Sequence[tuple[Result, int]]) -> ObservedPushes:
    history = history_of([one for one, _ in some])
    episodes = np.array([number for _, number in some])
    arrays = history.state, history.action, history.next_state
    return ObservedPushes(*arrays, episodes, bodies, history.noise)


@dataclass
class _Fitted:
    """A kind, and the latest fit of it to episodes."""

    kind: Kind
    fit: Fit | None = None
    episodes: tuple[str, ...] = ()

    def update(self, parts: list[ObservedPushes], episodes: list[str]) -> None:
        """Fit it anew, from where it is; new episodes begin with the mean of the others."""
        start, steps = None, identify.STEPS
        if self.fit is not None:
            places = dict(zip(self.episodes, self.fit.places, strict=True))
            mean = self.fit.places.mean(axis=0)
            start, steps = np.stack([places.get(name, mean) for name in episodes]), AGAIN
            start[:, ~self.kind.of_episode] = mean[~self.kind.of_episode]
        self.fit = identify.fit_laboratory(self.kind, parts, start, steps)
        self.episodes = tuple(episodes)

    @property
    def evidence(self) -> float:
        """The logarithm of its evidence; lowest where it was not fitted."""
        return -np.inf if self.fit is None else self.fit.evidence


class Believer:
    """Keeps a window of pushes, and what they say."""

    def __init__(self, base: SainDynamics) -> None:
        self._base = base
        self.window: deque[Result] = deque(maxlen=WINDOW)
        self.belief: Belief = base.belief
        self.parameters: Parameters = {}
        self._kinds: list[_Fitted] = []
        self._best: Kind | None = None  # as it is believed now, with all parameters
        self._anchor: Values = {}  # where the search begins after the table has changed
        self._compared = 0  # pushes when all kinds were fitted last
        self._total = 0  # pushes taken
        self._new = 0  # pushes that it was not inferred from
        self.jumped = 0.0  # what friction was before it jumped, within the window; 0: it did not

    def add(self, result: Result) -> None:
        """Take a push that no running episode conditions on."""
        self.window.append(result)
        self._total += 1
        self._new += 1

    def forget(self, keep: int, anchor: Values) -> None:
        """Keep the latest pushes only, and go on from these values: the table has changed."""
        self.window = deque(list(self.window)[-keep:] if keep else (), maxlen=WINDOW)
        self._anchor = dict(anchor)
        self._kinds, self._compared, self._new = [], 0, max(len(self.window), 1)

    def update(self) -> bool:
        """Infer anew where there are enough new pushes; return whether anything changed."""
        if not self._new or self._new < ENOUGH * len(self.window):
            return False
        self._new = 0
        if len(self.window) < FEWEST:
            changed = self.belief is not self._base.belief
            self.belief, self.parameters = self._base.belief, {}
            return changed
        self._fit()
        return True

    def _fit(self) -> None:
        parts, episodes = observed(self.window)
        flat = all(part.bodies.lie_flat for part in parts)
        candidates = laboratory_kinds(self._base.belief, flat)
        kinds = [anchored(kind, self._anchor) for kind in candidates]
        if [one.kind.name for one in self._kinds] != [kind.name for kind in kinds]:
            self._kinds, self._compared = [_Fitted(kind) for kind in kinds], 0
        fitted = [max(self._kinds, key=lambda one: one.evidence)]
        if self._total >= GROWTH * self._compared:
            self._compared, fitted = self._total, self._kinds
        for one in fitted:
            one.update(parts, episodes)
        self._conclude(parts)

    def _conclude(self, parts: list[ObservedPushes]) -> None:
        best, self.jumped = max(self._kinds, key=lambda one: one.evidence), 0.0
        fits = [self._of_now(one.fit) for one in self._kinds if one.fit is not None]
        found = identify.identified(fits, -identify.MOST_ODDS, {"laboratory": parts})
        kinds = [
            # a kind that was not fitted just now is compared by what it was
            replace(kind, log_odds=0.0 if one is best else -identify.MOST_ODDS)
            for kind, one in zip(found.kinds, self._kinds, strict=True)
        ]
        self._best = kinds[self._kinds.index(best)]
        self.parameters = self._best.stated
        settled = [kind.settled() for kind in kinds]
        if not any(kind.corrected for kind in settled):
            settled.append(replace(self._base.belief.trained, log_odds=-identify.MOST_ODDS))
        self.belief = Belief(tuple(settled), -identify.MOST_ODDS, {"pushes": len(self.window)})

    def _of_now(self, found: Fit) -> Fit:
        """Return a fit where what episodes have of their own is as it is since it has jumped."""
        places = found.places.copy()
        for column in np.flatnonzero(found.kind.of_episode):
            if first := latest_run(places[:, column]):
                before = found.kind.values(places[:first].mean(axis=0, keepdims=True))
                self.jumped = float(before[FRICTION][0])
                places[:first, column] = places[first:, column].mean()
        return replace(found, places=places)

    def recent(self, latest: Sequence[Result]) -> SainDynamics | None:
        """Return physics that the latest pushes alone may have moved from what is believed.

        It is what predicts better once the table has changed. None: there is no belief yet.
        """
        if self._best is None or not latest or self.belief is self._base.belief:
            return None
        kind = replace(self._best, covariance=WIDE**2 * np.eye(len(self._best.names)))
        parts, episodes = observed(latest)
        start = np.zeros((len(episodes), len(kind.names)))
        found = identify.fit_laboratory(kind, parts, start, LATEST)
        place = found.places.mean(axis=0)
        place[kind.of_episode] = found.places[-1][kind.of_episode]
        moved = kind.believing(place, np.eye(len(kind.names)))
        return physics_model(Belief((replace(moved.settled(), log_odds=0.0),)))

    @property
    def values(self) -> Values:
        """The values of all parameters that are believed, by name."""
        return {name: value for name, (value, _) in self.parameters.items()}

    @property
    def model(self) -> SainDynamics:
        """The physics as it is believed now; before the first fit the shipped model."""
        return self._base if self.belief is self._base.belief else physics_model(self.belief)


def latest_run(values: Float[ndarray, "C"]) -> int:
    """Return from which episode on values are about one mean: after the jump, if there was any.

    Two means with one scatter have to explain the values far better than one (Schwarz 1978).
    """
    count, floor = len(values), len(values) * identify.LEAST_SPREAD**2
    best, first = JUMPS + 2.0 * np.log(max(count, 1)), 0
    for split in range(FEW, count - 1):
        parts = values[:split], values[split:]
        apart = sum(part.var() * len(part) for part in parts)
        together = values.var() * count
        gain = 0.5 * count * np.log((together + floor) / (apart + floor))
        if gain > best:
            best, first = gain, split
    return first


def anchored(kind: Kind, values: Values) -> Kind:
    """Return a kind that is likely to have these values, but for what each episode has its own."""
    if not values or not isinstance(kind.prior, PlanarPrior):
        return kind
    known = {name: value for name, value in values.items() if name in kind.names}
    config = replace(kind.config, **known)
    deviations = np.where(kind.of_episode, 1.0, WIDE)
    return replace(
        kind, prior=replace(kind.prior, config=config), covariance=np.diag(deviations**2)
    )


def physics_model(belief: Belief) -> SainDynamics:
    """Return physics without a network, of the kinds that are not ruled out."""
    kinds = tuple(kind for kind in belief.kinds if kind.log_odds > RULED_OUT)
    first = replace(kinds[0], corrected=True)  # there is no network that could correct it
    return SainDynamics(
        replace(belief, kinds=(first, *kinds[1:])), origin=Origin(PHYSICS, "laboratory")
    )


BODY_GROWTH: Final = 0.05  # share of new pushes after which a body is fitted again
DIFFER: Final = 4  # bodies show how much they differ; fewer do not


@dataclass
class _Body:
    """The latest pushes of a body on a surface."""

    pushes: deque[Result] = field(default_factory=lambda: deque(maxlen=identify.ENOUGH))
    new: int = 0  # pushes that it was not fitted to


class BodyBeliever:
    """Keeps what pushes say of each body."""

    def __init__(self) -> None:
        self._population = Population.before(replace(surface_kind(), corrected=True))
        self._bodies: dict[Pair, _Body] = {}
        self._latest = Pair(identify.ANOTHER, identify.ANOTHER)  # the body that was pushed last

    def add(self, result: Result) -> None:
        """Take a push."""
        self._latest = Pair(result.object, result.surface)
        body = self._bodies.setdefault(self._latest, _Body())
        body.pushes.append(result)
        body.new += 1

    def update(self) -> bool:
        """Fit bodies with enough new pushes anew; return whether anything changed."""
        changed = {
            pair: observed(replace(push, episode=str(pair)) for push in body.pushes)[0]
            for pair, body in self._bodies.items()
            if body.new and body.new >= BODY_GROWTH * len(body.pushes)
        }
        if changed:
            self._population = self._population.learn(changed)
            if len(self._population.shown) >= DIFFER:
                self._population = self._population.learned()
        for pair in changed:
            self._bodies[pair].new = 0
        return bool(changed)

    def model(self, result: Result) -> SainDynamics:
        """Return the physics of the body of a push."""
        return physics_model(
            Belief((self._population.kind_of(Pair(result.object, result.surface)),))
        )

    @property
    def belief(self) -> Belief:
        """What is believed of a body that was not pushed yet."""
        bodies = {str(pair): self._population.kind_of(pair).stated for pair in self._bodies}
        return Belief((identify.another(self._population),), card={"bodies": bodies})

    @property
    def parameters(self) -> Parameters:
        """Values and spreads of the body that was pushed last."""
        return self._population.kind_of(self._latest).stated
