"""Dynamics of other packages in an evaluation: found by name, followed, and closed at the end.

What they offer through `sain_core.plugins` is taken as physics. It may be slow, as a simulator is
that makes every push in a world of its own, and it may hold something that has to be closed.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Final, Protocol, runtime_checkable

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from sain_core.dynamics import Dynamics
from sain_core.plugins import load_dynamics
from sain_core.types import Pushes, Scenes
from sain_model.evaluation.open_loop import CarriesState

AT_ONCE: Final = 32  # pushes between two looks at the clock


@runtime_checkable
class Closable(Protocol):
    """A dynamics that holds something."""

    def close(self) -> None:
        """Let go of it."""
        ...


@runtime_checkable
class Refusing(Protocol):
    """A dynamics that leaves scenes as they are where it cannot carry a push out."""

    refused: int
    """How many pushes so far."""


class Followed:
    """A dynamics that says how many pushes it has predicted, a few at a time."""

    def __init__(self, dynamics: Dynamics, advance: Callable[[float], None]) -> None:
        """Tell `advance` each number of pushes that this dynamics is done with."""
        self._dynamics = dynamics
        self._advance = advance

    @property
    def refused(self) -> int:
        """How many pushes it could not carry out."""
        return self._dynamics.refused if isinstance(self._dynamics, Refusing) else 0

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes (B, 3) from scenes (B, N, 8)."""
        predicted = np.empty_like(scenes)
        for first in range(0, len(pushes), AT_ONCE):
            rows = slice(first, first + AT_ONCE)
            predicted[rows] = self._dynamics.step(scenes[rows], pushes[rows])
            self._advance(len(pushes[rows]))
        return predicted


@contextmanager
def opened(names: Sequence[str]) -> Iterator[dict[str, Dynamics]]:
    """Give what installed packages offer under these names, and close it in the end.

    Raises:
        ConfigError: none offers one of the names.
    """
    with ExitStack() as stack:
        found: dict[str, Dynamics] = {}
        for name in names:
            dynamics = found[name] = load_dynamics(name)
            if isinstance(dynamics, Closable):
                stack.callback(dynamics.close)
        yield found


@contextmanager
def followed(
    dynamics: Mapping[str, Dynamics], pushes: int, console: Console
) -> Iterator[dict[str, Dynamics]]:
    """Give the same dynamics, each with a bar that shows how far it has come.

    One that carries a state through its rollouts is asked for whole ones, and has no bar.

    Args:
        dynamics: by name.
        pushes: how many each is going to predict.
        console: where the bars are shown.
    """
    if not dynamics:
        yield {}
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeRemainingColumn(), console=console) as bars:
        shown = dict(dynamics)
        for name, one in dynamics.items():
            if not isinstance(one, CarriesState):
                task = bars.add_task(name, total=pushes)
                shown[name] = Followed(one, partial(bars.advance, task))
        yield shown


def refusals(dynamics: Mapping[str, Dynamics]) -> dict[str, int]:
    """Return how many pushes each of these that counts them could not carry out."""
    return {name: one.refused for name, one in dynamics.items() if isinstance(one, Refusing)}
