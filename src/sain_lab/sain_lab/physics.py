"""What is believed of the physics of a laboratory: what `sain_model identify` does, push by push.

A window of pushes is fitted anew when an episode has ended, from the values found before: few steps
are enough. So cost and memory stay flat, and what is old is forgotten. Kinds of physics compete.
The one with the larger evidence predicts; the others are fitted when the pushes have grown by half.

Bodies that have names, each on its surface, as in a robot's recordings, have values of their own of
every parameter (`sain_model.inference.population`).
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
from sain_model.inference.episodes import Episodes
from sain_model.inference.evidence import ObservedPushes
from sain_model.inference.kinds import Belief, laboratory_kinds, surface_kind
from sain_model.inference.population import Pair, Population

WINDOW: Final = 300  # pushes that the belief is inferred from
FEWEST: Final = 5  # pushes that a belief is inferred from
AGAIN: Final = 10  # most steps of a fit that starts from the one before
ENOUGH: Final = 0.05  # share of new pushes after which it is inferred again
GROWTH: Final = 1.5  # of the pushes, after which all kinds are compared again
LEAST_SPREAD: Final = 0.1  # of z: over episodes
FEW: Final = 6  # episodes that show how much theirs differ
JUMPS: Final = 6.0  # logarithm of the odds, beforehand, that a parameter does not jump

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


class Believer:
    """Keeps a window of pushes, and what they say."""

    def __init__(self, base: SainDynamics) -> None:
        self._base = base
        self.window: deque[Result] = deque(maxlen=WINDOW)
        self.belief: Belief = base.belief
        self.model = base  # with what is believed now
        self.parameters: Parameters = {}
        self._kinds: list[Episodes] = []
        self._best = 0  # number of the kind that predicts
        self._compared = 0  # pushes when all kinds were fitted last
        self._total = 0  # pushes taken
        self._new = 0  # pushes that it was not inferred from
        self.jumped: dict[str, float] = {}  # values of parameters before they jumped, in the window

    def add(self, result: Result) -> None:
        """Take a push that no running episode conditions on."""
        self.window.append(result)
        self._total += 1
        self._new += 1

    def update(self) -> bool:
        """Infer anew where there are enough new pushes; return whether anything changed."""
        if not self._new or self._new < ENOUGH * len(self.window):
            return False
        self._new = 0
        if len(self.window) < FEWEST:
            changed = self.belief is not self._base.belief
            self.belief, self.model, self.parameters = self._base.belief, self._base, {}
            return changed
        self._fit()
        return True

    def _fit(self) -> None:
        parts, episodes = observed(self.window)
        flat = all(part.bodies.lie_flat for part in parts)
        kinds = laboratory_kinds(self._base.belief, flat)
        if [one.kind.name for one in self._kinds] != [kind.name for kind in kinds]:
            self._kinds, self._compared = list(map(Episodes.before, kinds)), 0
        compares = self._total >= GROWTH * self._compared
        for number in range(len(kinds)) if compares else [self._best]:
            self._kinds[number] = self._kinds[number].learn(parts, episodes, AGAIN)
        if compares:
            self._compared = self._total
            self._best = int(np.argmax([one.evidence for one in self._kinds]))
        best = self._of_now(self._kinds[self._best])
        found = identify.identified(self._base, [best], {"laboratory": parts})
        self.parameters = best.kind.believing(best.mean, best.covariance).stated
        self.belief = replace(found, card={"pushes": len(self.window)})
        self.model = self._base.believing(self.belief)

    def _of_now(self, found: Episodes) -> Episodes:
        """Return episodes whose mean is as it is since a parameter has jumped."""
        mean, places, self.jumped = found.mean.copy(), found.means, {}
        for column, name in enumerate(found.kind.names):
            if first := latest_run(places[:, column]):
                before = found.kind.values(places[:first].mean(axis=0, keepdims=True))
                self.jumped[name] = float(before[name][0])
                mean[column] = places[first:, column].mean()
        return replace(found, mean=mean)

    @property
    def values(self) -> Values:
        """The values of all parameters that are believed, by name."""
        return {name: value for name, (value, _) in self.parameters.items()}


def latest_run(values: Float[ndarray, "C"]) -> int:
    """Return from which episode on values are about one mean: after the jump, if there was any.

    Two means with one scatter have to explain the values far better than one (Schwarz 1978).
    """
    count, floor = len(values), len(values) * LEAST_SPREAD**2
    best, first = JUMPS + 2.0 * np.log(max(count, 1)), 0
    for split in range(FEW, count - 1):
        parts = values[:split], values[split:]
        apart = sum(part.var() * len(part) for part in parts)
        together = values.var() * count
        gain = 0.5 * count * np.log((together + floor) / (apart + floor))
        if gain > best:
            best, first = gain, split
    return first


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
        kind = self._population.kind_of(Pair(result.object, result.surface))
        return SainDynamics(Belief((kind,)), origin=Origin(PHYSICS, "laboratory"))

    @property
    def belief(self) -> Belief:
        """What is believed of a body that was not pushed yet."""
        bodies = {str(pair): self._population.kind_of(pair).stated for pair in self._bodies}
        return Belief((identify.another(self._population),), card={"bodies": bodies})

    @property
    def parameters(self) -> Parameters:
        """Values and spreads of the body that was pushed last."""
        return self._population.kind_of(self._latest).stated
