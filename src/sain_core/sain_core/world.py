"""The contract of worlds: what executes pushes, simulated or real, ours or of a stranger."""

from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np

from sain_core.errors import SainError
from sain_core.scene import MASS, POSITION, SETTLED_SPEED, SETTLED_SPIN, is_settled
from sain_core.shapes.bodies import Bodies
from sain_core.types import Mask, PushArray, Scalars, Scene

MOST_WAY = 2.0  # [m], of a body in a push: several times as far as an arm reaches

Start = TypeVar("Start", contravariant=True)


class DivergedError(SainError):
    """A push in which an engine found no possible solution: there is no outcome."""


class WorldFailedError(SainError):
    """A world that raised what it should not, or that broke its contract."""


@dataclass(frozen=True, eq=False)
class Setting:
    """What an episode of a simulated world begins with.

    Attributes:
        scene: (N, 8), at rest.
        bodies: shapes and roles.
        friction: between bodies and table.
    """

    scene: Scene
    bodies: Bodies
    friction: float


@dataclass(frozen=True, eq=False)
class Outcome:
    """An executed push: the scenes (N, 8) before and after it, at rest.

    Attributes:
        before: it.
        after: it.
        duration: simulated time [s].
        settled: False when bodies still moved after the longest wait.
        fallen: (N,) which bodies are no longer on the table; None: the world does not tell.
    """

    before: Scene
    after: Scene
    duration: float = 0.0
    settled: bool = True
    fallen: Mask | None = None


@dataclass(frozen=True, eq=False)
class PushRecord:
    """A push that was executed, however it was run: closed loop, graph, bag.

    Attributes:
        push: as executed.
        before: (N, 8), settled.
        after: (N, 8), settled.
        predicted: (N, 8), what the planner's model expected.
        physics: (N, 8), what the nominal world expected, f_p.
        planning_time: [s].
        noise: (N,) [m], of estimated scenes: see `sain_core.history.PushHistory`.
    """

    push: PushArray
    before: Scene
    after: Scene
    predicted: Scene | None = None
    physics: Scene | None = None
    planning_time: float = 0.0
    noise: Scalars | None = None

    def error(self, body: int) -> float | None:
        """Return how far [m] the prediction put a body from where it came to rest."""
        return self._apart(self.predicted, body)

    def physics_error(self, body: int) -> float | None:
        """Return how far [m] physics alone put a body from where it came to rest."""
        return self._apart(self.physics, body)

    def _apart(self, expected: Scene | None, body: int) -> float | None:
        if expected is None:
            return None
        return float(np.hypot(*(expected[body, POSITION] - self.after[body, POSITION])))


@runtime_checkable
class AnyWorld(Protocol[Start]):
    """Executes pushes, one after another.

    `Start` is what an episode begins with: a `Setting` for worlds that are found by name.
    """

    def reset(self, start: Start, /) -> Scene:
        """Begin an episode; return its first scene (N, 8)."""
        ...

    def observe(self) -> Scene:
        """Return the scene (N, 8) as it is."""
        ...

    def push(self, push: PushArray, *, seen: Scene | None = None) -> Outcome:
        """Execute a push, and wait until nothing moves.

        `seen` (N, 8) is the scene that the push was planned from; the tool's way follows from it
        (`sain_core.push.strokes`). None: the scene as it is.

        Raises:
            SainError: the push cannot be executed, and why; nothing has moved.
        """
        ...


def check_possible(before: Scene, after: Scene) -> None:
    """Raise `DivergedError` for a scene (N, 8) that no push can lead to from another one."""
    ways = np.hypot(*(after - before)[:, POSITION].T)
    impossible = ~(np.isfinite(after).all(axis=1) & (ways <= MOST_WAY))
    if impossible.any():
        body = int(np.argmax(impossible))
        raise DivergedError(
            f"the engine found no solution of the push: body {body} would end {ways[body]:.3g} m"
            f" from where it was; possible are {MOST_WAY:g} m"
        )


def check_outcome(before: Scene, after: object) -> Scene:
    """Return a scene (N, 8) that a stranger's world returned after a push from another one.

    Raises:
        WorldFailedError: it breaks the contract, and how.
    """
    if not isinstance(after, np.ndarray) or after.shape != before.shape:
        form = getattr(after, "shape", type(after).__name__)
        raise WorldFailedError(f"the scene is {form}; allowed: an array {before.shape}")
    finite, ways = np.isfinite(after).all(axis=1), np.hypot(*(after - before)[:, POSITION].T)
    if not finite.all():
        body = int(np.argmin(finite))
        raise WorldFailedError(f"body {body} has NaN or Inf; allowed: finite numbers")
    if ways.max() > MOST_WAY:
        way = f"body {int(np.argmax(ways))} is {ways.max():.3g} m from where it was"
        raise WorldFailedError(f"{way}; allowed: up to {MOST_WAY:g} m")
    if not np.array_equal(after[:, MASS:], before[:, MASS:]):
        raise WorldFailedError("masses or radii changed; allowed: those of the first scene")
    if not is_settled(after):
        raise WorldFailedError(
            "the scene did not settle; allowed: every body slower than"
            f" {SETTLED_SPEED:g} m/s and {SETTLED_SPIN:g} rad/s"
        )
    return after
