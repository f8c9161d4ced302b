"""What is believed of bodies that have names, each on its surface, as a robot's recordings state.

Each body has values of its own of every parameter. A body that was not pushed yet has the mean and
the spread of the others.
"""

from collections import deque
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_lab.keeping.results import Result
from sain_lab.physics import Parameters, observed, parameters_of, physics_model
from sain_model.dynamics.identify import ENOUGH, of_another_body, on_surfaces
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.gauss_newton import fit
from sain_model.inference.kinds import Belief, Kind, surface_kind

FIRST: Final = 12  # steps of the first fit of a body
AGAIN: Final = 3
GROWTH: Final = 0.05  # share of new pushes after which a body is fitted again


@dataclass
class _Body:
    """A body on a surface: its latest pushes, and the vector z that explains them."""

    pushes: deque[Result] = field(default_factory=lambda: deque(maxlen=ENOUGH))
    place: Float[ndarray, "D"] | None = None
    covariance: Float[ndarray, "D D"] | None = None
    new: int = 0  # pushes that it was not fitted to


class BodyBeliever:
    """Keeps what pushes say of each body."""

    def __init__(self) -> None:
        self._kind = surface_kind()
        self._bodies: dict[str, _Body] = {}
        self._latest = ""  # the body that was pushed last

    def add(self, result: Result) -> None:
        """Take a push."""
        self._latest = body_name(result)
        body = self._bodies.setdefault(self._latest, _Body())
        body.pushes.append(result)
        body.new += 1

    def update(self) -> bool:
        """Fit bodies with enough new pushes anew; return whether anything changed."""
        changed = False
        for name, body in self._bodies.items():
            if body.new and body.new >= GROWTH * len(body.pushes):
                self._fit(name, body)
                changed = True
        return changed

    def _fit(self, name: str, body: _Body) -> None:
        kind, mean = self._another(name)
        parts, _ = observed(body.pushes)
        parts = [part.in_episodes(np.zeros(len(part), np.int64)) for part in parts]
        start = np.zeros_like(mean) if body.place is None else body.place - mean
        steps = FIRST if body.place is None else AGAIN
        found = fit(kind, parts, start[None], np.zeros(1, np.int64), steps)
        body.place, body.covariance, body.new = found.places[0] + mean, found.covariance[0], 0

    def _another(self, name: str) -> tuple[Kind, Float[ndarray, "D"]]:
        """Return what bodies other than this one show of it, and their mean vector z."""
        others = [
            body.place
            for other, body in self._bodies.items()
            if other != name and body.place is not None
        ]
        if not others:
            return self._kind, np.zeros(len(self._kind.names))
        places = np.stack(others)
        return of_another_body(self._kind, places), places.mean(axis=0)

    def kind(self, name: str) -> Kind:
        """Return what is believed of a body, known or not."""
        body = self._bodies.get(name)
        if body is None or body.place is None or body.covariance is None:
            return self._another(name)[0]
        return replace(self._kind, prior=self._kind.at(body.place), covariance=body.covariance)

    def model(self, result: Result) -> SainDynamics:
        """Return the physics of the body of a push."""
        return physics_model(self.belief(body_name(result)))

    def belief(self, name: str = "") -> Belief:
        """Return what is believed of a body; without a name of one that was not pushed yet."""
        kind = replace(self.kind(name), corrected=True)
        bodies = {one: parameters_of(self.kind(one)) for one in self._bodies}
        return Belief((kind,), card={"bodies": bodies})

    @property
    def parameters(self) -> Parameters:
        """Values and spreads of the body that was pushed last."""
        return parameters_of(self.kind(self._latest))


def body_name(result: Result) -> str:
    """Return the name of the body of a push on its surface."""
    return str(on_surfaces(np.array([result.object]), np.array([result.surface]))[0])
