"""What is believed of the physics of a laboratory, from its latest pushes: the one inference.

A window of pushes is fitted anew when episodes have ended, from the values found before. So cost
and memory stay flat, and what is old is forgotten.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from sain_core.shapes.bodies import Bodies
from sain_lab.keeping.results import Result, history_of
from sain_model.dynamics.identify import identify
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.evidence import ObservedPushes
from sain_model.inference.kinds import Belief, written_kind

WINDOW: Final = 400  # pushes that the belief is inferred from


def observed(results: Iterable[Result]) -> list[ObservedPushes]:
    """Return pushes for inference, those of the same bodies together; episodes count from 0."""
    groups: dict[tuple[Bodies, int], list[tuple[Result, int]]] = {}
    numbers: dict[str, int] = {}
    for count, one in enumerate(results):
        name = one.episode or f"\0{count}"
        number = numbers.setdefault(name, len(numbers))
        groups.setdefault((one.own_bodies, len(one.push)), []).append((one, number))
    return [_joined(bodies, some) for (bodies, _), some in groups.items()]


def _joined(bodies: Bodies, some: Sequence[tuple[Result, int]]) -> ObservedPushes:
    history = history_of([one for one, _ in some])
    episodes = np.array([number for _, number in some])
    arrays = history.state, history.action, history.next_state
    return ObservedPushes(*arrays, episodes, bodies, history.noise)


class Believer:
    """Keeps a window of pushes, and what they say."""

    def __init__(self, base: SainDynamics) -> None:
        """Begin with what the shipped model believes."""
        self._base = base
        self.belief: Belief = base.belief
        self.window: deque[Result] = deque(maxlen=WINDOW)
        self._stale = False

    def add(self, result: Result) -> None:
        """Take a push that no running episode conditions on."""
        self.window.append(result)
        self._stale = True

    def forget(self, keep: int) -> None:
        """Keep the latest pushes only: the table has changed."""
        self.window = deque(list(self.window)[-keep:] if keep else (), maxlen=WINDOW)
        self._stale = True

    def update(self) -> bool:
        """Infer anew where there are new pushes; return whether anything changed."""
        if not self._stale:
            return False
        self._stale = False
        if not self.window:
            self.belief = self._base.belief
            return True
        found = identify(self._base, {"laboratory": observed(self.window)})
        self.belief = replace(found, card={"pushes": len(self.window)})
        return True

    @property
    def parameters(self) -> dict[str, tuple[float, float]]:
        """Values and spreads of the likeliest physics, as `written_kind` has them, by name."""
        parts = written_kind(self.belief.likeliest)["parameters"]
        return {part["name"]: (part["mean"], part["spread"]) for part in parts}

    @property
    def model(self) -> SainDynamics:
        """The physics as it is believed now, with the shipped network where that holds."""
        return self._base.believing(self.belief)
