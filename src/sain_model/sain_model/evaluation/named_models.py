"""Models to compare with: found by name, checked, shown at work, and closed at the end.

A model may be slow, as a simulator is that makes every push in a world of its own, and it may hold
something that has to be closed.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Final

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from sain_core.model import Model, answering, check_step, load_dynamics
from sain_core.scene import MASS, MID, RADIUS
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scenes
from sain_model.physics.planar import PlanarPrior

NOMINAL_MASS: Final = 8.0  # [kg], the paper, section III-A
NOMINAL_MID_RADIUS: Final = 0.08  # [m]
NOMINAL_RADIUS: Final = 0.06  # [m], of every other disk
AT_ONCE: Final = 32  # pushes between two looks at the clock


def step_as_nominal(prior: PlanarPrior, scenes: Scenes, pushes: Pushes) -> Scenes:
    """Predict as `prior`, believing that every body has nominal mass, every disk nominal radius."""
    believed = scenes.copy()
    believed[..., MASS] = NOMINAL_MASS
    if prior.bodies.all_round:
        believed[..., RADIUS] = NOMINAL_RADIUS
        believed[:, MID, RADIUS] = NOMINAL_MID_RADIUS
    return prior.step_as_if(scenes, believed, pushes)[0]


class Followed(Model):
    """A model whose answers are checked, and that reports how many pushes it has predicted."""

    def __init__(self, label: str, dynamics: Model, advance: Callable[[float], None]) -> None:
        """Call `advance` with each number of pushes that this dynamics is done with."""
        self._label = label
        self._dynamics = dynamics
        self._advance = advance

    def with_bodies(self, bodies: Bodies) -> "Followed":
        """Return the model for these bodies, followed likewise."""
        return Followed(self._label, self._dynamics.with_bodies(bodies), self._advance)

    @property
    def refused(self) -> int | None:
        """How many pushes it could not carry out; None: it does not count them."""
        return self._dynamics.refused

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes (B, 5) from scenes (B, N, 8).

        Raises:
            ModelUnavailableError: the dynamics fails, or its answer cannot be one.
        """
        predicted = np.empty_like(scenes)
        for first in range(0, len(pushes), AT_ONCE):
            rows = slice(first, first + AT_ONCE)
            with answering(self._label):
                answer = self._dynamics.step(scenes[rows], pushes[rows])
            predicted[rows] = check_step(answer, scenes[rows], self._label)
            self._advance(len(pushes[rows]))
        return predicted


@contextmanager
def open_models(names: Sequence[str]) -> Iterator[dict[str, Model]]:
    """Give the models of these names, and close them in the end.

    Raises:
        ConfigError, CheckpointError: see `sain_core.model.load_dynamics`.
    """
    with ExitStack() as stack:
        found: dict[str, Model] = {}
        for name in names:
            found[name] = load_dynamics(name)
            stack.callback(found[name].close)
        yield found


@contextmanager
def followed(
    dynamics: Mapping[str, Model], pushes: int, console: Console
) -> Iterator[dict[str, Model]]:
    """Give the same dynamics, each with a bar that shows how far it has come.

    Each is going to predict so many pushes.
    """
    if not dynamics:
        yield {}
        return
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, TimeRemainingColumn(), console=console) as bars:
        yield {
            name: Followed(
                f"model {name!r}", one, partial(bars.advance, bars.add_task(name, total=pushes))
            )
            for name, one in dynamics.items()
        }


def refusals(dynamics: Mapping[str, Model]) -> dict[str, int]:
    """Return how many pushes each of these that counts them could not carry out."""
    counts = {name: one.refused for name, one in dynamics.items()}
    return {name: count for name, count in counts.items() if count is not None}
