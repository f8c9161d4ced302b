"""The contract of worlds, simulated or real, ours or of a stranger: they execute pushes.

And how exactly a world's bodies are observed: what a camera does, and what a planner expects of it.
"""

from dataclasses import dataclass, fields
from math import isfinite
from typing import Any, Final, Protocol, TypeVar, runtime_checkable

import numpy as np

from sain_core.config import Config, option
from sain_core.errors import ConfigError, ErrorCode, SainError
from sain_core.guarding.plugins import did_you_mean
from sain_core.scene import MASS, POSITION, SETTLED_SPEED, SETTLED_SPIN, is_settled
from sain_core.shapes.bodies import Bodies
from sain_core.types import Mask, PushArray, Scalars, Scene

MOST_WAY = 2.0  # [m], of a body in a push: several times as far as an arm reaches

Start = TypeVar("Start", contravariant=True)


class DivergedError(SainError):
    """A push in which an engine found no possible solution: there is no outcome."""


class ToppledError(DivergedError):
    """A push that tipped a body over: what follows is not in a plane."""


class WorldFailedError(SainError):
    """A world that raised what it should not, or that broke its contract."""


@dataclass(frozen=True, eq=False)
class Setting:
    """What an episode of a simulated world begins with."""

    scene: Scene  # (N, 8), at rest
    bodies: Bodies  # shapes and roles
    friction: float  # between bodies and table


@dataclass(frozen=True, eq=False)
class Outcome:
    """An executed push: the scenes (N, 8) before and after it, at rest."""

    before: Scene
    after: Scene
    duration: float = 0.0  # [s], simulated
    settled: bool = True  # False when bodies still moved after the longest wait
    fallen: Mask | None = None  # (N,), who is off the table; None: the world does not tell


@dataclass(frozen=True, eq=False)
class PushRecord:
    """A push that was executed or refused, however it was run: closed loop, graph, bag."""

    push: PushArray  # (5,), or a stroke (8,), as executed
    before: Scene  # (N, 8), settled
    after: Scene  # (N, 8), settled
    predicted: Scene | None = None  # (N, 8), what the planner's model expected
    physics: Scene | None = None  # (N, 8), what the nominal world expected, f_p
    planning_time: float = 0.0  # [s]
    duration: float = 0.0  # [s] of the world; 0: not measured
    noise: Scalars | None = None  # (N,) [m]: see `sain_core.transitions.PushHistory`
    code: int = ErrorCode.OK  # or why it was refused; then `after` is `before`
    message: str = ""  # of the refusal

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
        """Execute a push, and wait until nothing moves; raise `SainError` where nothing has moved.

        `seen` (N, 8) is the scene that the push was planned from; the tool's way follows from it
        (`sain_core.push.strokes`). None: the scene as it is.
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
    """Return a scene (N, 8) that a stranger's world returned after a push from another one."""
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


MOST_NOISE: Final = (0.02, 0.35)  # [m], a third of the smallest disk's radius; [rad], 20 degrees
UNITS: Final = ("m", "rad")
MASSES: Final = "mass"
UNKNOWNS: Final = (MASSES,)


@dataclass(frozen=True)
class ObservationConfig(Config):
    """Errors of observed poses. The defaults are exact and immediate observations."""

    noise: str = option(
        "0,0",
        "standard deviation of observed positions [m] and headings [rad], drawn anew for each"
        " frame: METRES,RADIANS",
    )
    bias: str = option("0,0", "as noise, but drawn once for each body and episode: METRES,RADIANS")
    delay: float = option(
        0.0, "time from the observation of a frame to its arrival", unit="s", minimum=0, maximum=0.5
    )
    unknown: str = option("", "quantities that are observed as nominal, separated by commas: mass")

    def __post_init__(self) -> None:
        """Check the fields, the numbers in words, and the names of what is unknown."""
        super().__post_init__()
        for name in ("noise", "bias"):
            self._pair(name)
        unknown_names(self.unknown)

    @property
    def noise_std(self) -> tuple[float, float]:
        """The noise of a frame, [m] and [rad]."""
        return self._pair("noise")

    @property
    def bias_std(self) -> tuple[float, float]:
        """The bias of an episode, [m] and [rad]."""
        return self._pair("bias")

    @property
    def unknown_names(self) -> tuple[str, ...]:
        """What is not measured."""
        return unknown_names(self.unknown)

    @property
    def is_exact(self) -> bool:
        """Whether what is observed is the truth, at once."""
        return not (any(self.noise_std) or any(self.bias_std) or self.delay or self.unknown_names)

    def _pair(self, name: str) -> tuple[float, float]:
        text = getattr(self, name)
        try:
            place, turn = (float(word) for word in text.split(","))
        except ValueError as error:
            raise ConfigError(
                f"{name} is {text!r}; allowed: two numbers with a comma, METRES,RADIANS, for"
                " example 0.005,0.035"
            ) from error
        for value, most, unit in zip((place, turn), MOST_NOISE, UNITS, strict=True):
            if not (isfinite(value) and 0.0 <= value <= most):
                raise ConfigError(
                    f"{name} has a standard deviation of {value:g} {unit}; allowed: 0 to"
                    f" {most:g} {unit}, with which a body is still where it is seen"
                )
        return place, turn


def unknown_names(text: str) -> tuple[str, ...]:
    """Return what is not measured, by a text of names with commas; raises `ConfigError`."""
    names = tuple(dict.fromkeys(word.strip() for word in text.split(",") if word))
    for name in names:
        if name not in UNKNOWNS:
            hint = did_you_mean(name, UNKNOWNS)
            raise ConfigError(f"unknown is {text!r}{hint}; allowed: {', '.join(UNKNOWNS)}")
    return names


def observation_settings(config: ObservationConfig) -> dict[str, Any]:
    """Return what a planner is given of a camera, by the names of `ObservationConfig`."""
    return {item.name: getattr(config, item.name) for item in fields(ObservationConfig)}


def changed_settings(config: ObservationConfig) -> dict[str, Any]:
    """Return those of `observation_settings` that are not as in exact observations."""
    exact = ObservationConfig()
    settings = observation_settings(config).items()
    return {name: value for name, value in settings if value != getattr(exact, name)}
