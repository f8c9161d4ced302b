"""The parameters of the planar prior: settings, rows of the kernels, and what inference reads.

To add one, declare it in `PlanarConfig`, and use it in the solver, where it has this name. What a
prior is given is checked here, once.
"""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import lru_cache, partial
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.config import Config, option
from sain_core.errors import InvalidInputError
from sain_core.push import BODY, PUSH_SIZE, STROKE_SIZE, TOOL_RADIUS, check_predictable
from sain_core.scene import MASS, MID, RADIUS, STATE_NAMES, STATE_SIZE
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Scenes


def check_batch(scenes: np.ndarray, pushes: np.ndarray, bodies: Bodies = PAPER_DISKS) -> None:
    """Check that scenes (B, N, 8) and pushes (B, 5) or strokes (B, 11) fit and can exist.

    Raises `InvalidInputError`: naming what does not; `OutOfRangeError`: a push that no model may be
    asked about, see `check_predictable`.
    """
    most = len(bodies)
    least = 1 if bodies.are_paper_disks else most
    allowed = f"N = {most}" if least == most else f"N = {least} to {most}"
    if scenes.ndim != 3 or scenes.shape[2] != STATE_SIZE or not least <= scenes.shape[1] <= most:
        raise InvalidInputError(f"scenes have shape (B, N, 8) with {allowed}, not {scenes.shape}")
    if pushes.ndim != 2 or len(pushes) != len(scenes):
        raise InvalidInputError(
            f"pushes have shape ({len(scenes)}, {PUSH_SIZE}), one for each scene, or"
            f" ({len(scenes)}, {STROKE_SIZE}), not {pushes.shape}"
        )
    check_finite("scenes", scenes)
    check_predictable(pushes)
    _check_pushed(pushes[:, BODY], scenes.shape[1])
    for column in (MASS, RADIUS):
        if (scenes[..., column] <= 0.0).any():
            scene, disk = (int(i) for i in np.argwhere(scenes[..., column] <= 0.0)[0])
            raise InvalidInputError(
                f"{STATE_NAMES[column]} of disk {disk} in scene {scene} is"
                f" {scenes[scene, disk, column]}; it must be positive"
            )


def _check_pushed(pushed: np.ndarray, count: int) -> None:
    wrong = ~((pushed >= 0) & (pushed < count) & (pushed == np.floor(pushed)))
    if wrong.any():
        index = int(np.argmax(wrong))
        raise InvalidInputError(
            f"push {index} is against body {pushed[index]:g};"
            f" the scenes have bodies 0 to {count - 1}"
        )


def check_finite(name: str, values: np.ndarray) -> None:
    """Check that values are finite; raises `InvalidInputError`: naming the first that is not."""
    if not np.isfinite(values).all():
        where = tuple(int(i) for i in np.argwhere(~np.isfinite(values))[0])
        raise InvalidInputError(f"{name}{list(where)} is {values[where]}; it must be finite")


Scope = Literal["body", "table", "tool", "episode"]
Values = Mapping[str, ndarray]  # (B,) by name; parameters of bodies (B,) for all, or (B, N)


class Parameter(NamedTuple):
    """One parameter of the physics, and what is believed of it before any push."""

    name: str  # the field of `PlanarConfig`, of the solver's rows, and of `Values`
    meaning: str  # in plain words
    unit: str  # of its value; empty for a share or a factor
    # what it belongs to. A value for each body may be given for those of scope "body"; each episode
    # has its own of scope "episode"
    scope: Scope
    spread: float  # standard deviation before any push
    logarithm: bool  # whether the spread is that of the logarithm
    least: float  # smallest value
    most: float  # largest value


HARMONICS: Final = (("cos", 1), ("sin", 1), ("cos", 2), ("sin", 2))  # by which offsets differ


def parameter(
    default: float,
    meaning: str,
    scope: Scope,
    spread: float,
    least: float,
    most: float,
    unit: str = "",
    logarithm: bool = False,
) -> Any:
    """Declare a parameter of `PlanarConfig`; see `Parameter`."""
    setting: Any = option(default, meaning, unit=unit, minimum=least, maximum=most)
    about = Parameter("", meaning, unit, scope, spread, logarithm, least, most)
    return field(default=default, metadata={**setting.metadata, "parameter": about})


factor: Final = partial(parameter, logarithm=True)  # the spread is of the logarithm


def harmonic(spread: float, most: float, unit: str = "rad") -> Any:
    """Declare how an offset of the tool changes with its heading in the world."""
    meaning = "likewise, times cos or sin of 1 or 2 x the heading of the tool in the world"
    return parameter(0.0, meaning, "tool", spread, -most, most, unit)


# fmt: off
@dataclass(frozen=True)
class PlanarConfig(Config):
    """The planar world's physics.

    From `foot_radius` to `disk_height` the values are fitted to Bullet with the arm on 1,871
    pushes of three-footed disks (docs/explanation/planar.md): they make up for each other, and none
    should be read as a measurement.
    """

    friction: float = factor(0.12, "friction with the table", "episode", 0.5, 0.005, 10.0)
    friction_scale: float = factor(
        1.01, "friction with the table at work, share of the coefficient", "body", 0.1, 0.2, 5.0
    )
    tool_friction: float = factor(0.1211, "friction with the tool", "body", 0.5, 0.0, 5.0)
    disk_friction: float = factor(
        0.1254, "friction with bodies that are nearer to the push", "body", 0.5, 0.0, 5.0
    )
    tool_restitution: float = parameter(
        0.0036, "bounce off the tool, share of the speed", "tool", 0.15, 0.0, 0.9
    )
    disk_restitution: float = parameter(
        0.003, "bounce between bodies, share of the speed", "table", 0.15, 0.0, 0.9
    )
    tool_compliance: float = parameter(
        0.0, "how far the contact of the tool gives, 0: not at all", "tool", 5e-5, 0.0, 5e-4, "m/N"
    )
    body_compliance: float = parameter(
        0.0, "how far contacts of bodies give, 0: not at all", "episode", 5e-5, 0.0, 5e-4, "m/N"
    )
    foot_radius: float = factor(
        0.7345, "where a disk's three feet stand, share of its radius", "table", 0.1, 0.2, 1.0
    )
    torsion: float = factor(
        1.0, "torsion length, share of the one that the supports give", "body", 0.2, 0.2, 5.0
    )
    inertia: float = factor(
        0.4257,
        "moment of inertia, share of mass x radius^2 for a disk; likewise for others",
        "body", 0.2, 0.05, 2.0,
    )
    tool_height: float = parameter(
        0.0283, "height at which the tool presses on a body", "tool", 0.008, 0.0, 0.06, "m"
    )
    disk_height: float = parameter(
        0.0264, "height at which bodies press on each other", "table", 0.008, 0.0, 0.06, "m"
    )
    middle_height: float = parameter(
        0.0181, "height of a body's centre of mass", "table", 0.004, 0.0, 0.05, "m"
    )
    speed_factor: float = factor(
        1.0, "speed of the tool, share of the push's", "tool", 0.05, 0.1, 10.0
    )
    yield_across: float = parameter(
        0.7779,
        "weight of a foot's motion across its arm in the direction of its friction: a solver"
        " gives way to where a foot is lighter to move",
        "table", 0.15, 0.1, 1.0,
    )
    axes_yield: float = parameter(
        0.0,
        "a solver weighs a foot's friction along the world's x and y by how hard the foot is to"
        " move that way, 1 / (1 + this x its share across)",
        "table", 0.3, 0.0, 5.0,
    )
    mass_ratio: float = factor(
        1.0, "masses of bodies 1 and on over that of body 0, times what scenes state",
        "episode", 0.3, 0.02, 50.0,
    )
    pressure: float = parameter(
        0.0,
        "of a flat bottom: exponent of the distance from its middle; 0: the same everywhere",
        "body", 0.5, -1.0, 8.0,
    )
    centre_x: float = parameter(
        0.0, "centre of mass from the centroid, in the body's frame and radii",
        "body", 0.05, -0.6, 0.6,
    )
    centre_y: float = parameter(0.0, "likewise to the body's left", "body", 0.05, -0.6, 0.6)
    grain_x: float = parameter(
        0.0,
        "half of the share by which friction is larger along a body's own x axis than along its y",
        "body", 0.05, -0.3, 0.3,
    )
    grain_y: float = parameter(0.0, "likewise along its two diagonals", "body", 0.05, -0.3, 0.3)
    table_grain_x: float = parameter(
        0.0,
        "half of the share by which friction is larger along the world's x axis than along its y",
        "table", 0.05, -0.3, 0.3,
    )
    table_grain_y: float = parameter(
        0.0, "likewise along its two diagonals", "table", 0.05, -0.3, 0.3
    )
    slope_x: float = parameter(
        0.0, "acceleration along the world's x, as on a slope", "body", 0.1, -0.5, 0.5, "m/s^2"
    )
    slope_y: float = parameter(
        0.0, "likewise along the world's y", "body", 0.1, -0.5, 0.5, "m/s^2"
    )
    tip_x: float = parameter(
        0.0, "where the tool is from where it is said to be, along the world's x",
        "tool", 0.001, -0.02, 0.02, "m",
    )
    tip_y: float = parameter(
        0.0, "likewise along the world's y", "tool", 0.001, -0.02, 0.02, "m"
    )
    length_offset: float = parameter(
        0.0, "how much further the tool goes", "tool", 0.002, -0.05, 0.05, "m"
    )
    angle_offset: float = parameter(
        0.0, "how far to the left it goes", "tool", 0.02, -0.5, 0.5, "rad"
    )
    location_offset: float = parameter(
        0.0, "how far around the body it starts, its heading kept", "tool", 0.02, -0.5, 0.5, "rad"
    )
    length_offset_cos1: float = harmonic(0.0007, 0.02, "m")
    length_offset_sin1: float = harmonic(0.0007, 0.02, "m")
    length_offset_cos2: float = harmonic(0.0007, 0.02, "m")
    length_offset_sin2: float = harmonic(0.0007, 0.02, "m")
    angle_offset_cos1: float = harmonic(0.007, 0.2)
    angle_offset_sin1: float = harmonic(0.007, 0.2)
    angle_offset_cos2: float = harmonic(0.007, 0.2)
    angle_offset_sin2: float = harmonic(0.007, 0.2)
    location_offset_cos1: float = harmonic(0.007, 0.2)
    location_offset_sin1: float = harmonic(0.007, 0.2)
    location_offset_cos2: float = harmonic(0.007, 0.2)
    location_offset_sin2: float = harmonic(0.007, 0.2)

    gravity: float = option(9.81, "acceleration", unit="m/s^2", minimum=0.1, maximum=30.0)
    tool_radius: float = option(TOOL_RADIUS, "radius of the stick", unit="m", minimum=0.001)
    clearance: float = option(
        0.005, "gap between tool and rim at the start", unit="m", minimum=0.0, maximum=0.05
    )
    acceleration: float = option(4.0, "of the tool", unit="m/s^2", minimum=0.1, maximum=50.0)
    longest_step: float = option(
        0.02, "of time; all limits of steps scale with it", unit="s", minimum=1e-4, maximum=0.1
    )

    @property
    def has_axes(self) -> bool:
        """Whether friction is solved along the world's axes."""
        return self.axes_yield > 0.0
# fmt: on


BY_NAME: Final[dict[str, Parameter]] = {
    item.name: item.metadata["parameter"]._replace(name=item.name)
    for item in fields(PlanarConfig)
    if "parameter" in item.metadata
}
BY_HEADING: Final = tuple(name for name in BY_NAME if "_offset_" in name)

# The same in all rows, but for the radius of the tool: a stroke has its own.
SETTINGS: Final = ("gravity", "tool_radius", "acceleration", "longest_step")
OF_BODIES: Final = tuple(name for name, one in BY_NAME.items() if one.scope == "body")
OF_PUSHES: Final = (*(name for name in BY_NAME if name not in OF_BODIES), *SETTINGS)
PUSH_ROW: Final = np.dtype([(name, np.float64) for name in OF_PUSHES])
BODY_ROW: Final = np.dtype([(name, np.float64) for name in OF_BODIES])


def rows_of(
    config: Hashable, each: Sequence[Hashable], values: Values, batch: int, bodies: int
) -> tuple[ndarray, ndarray]:
    """Return what the solver reads for each push: `PUSH_ROW` (B,), and `BODY_ROW` (B, N).

    `config`, and `each` of the first bodies, have what the checked `values` have not; see
    `check_values`.
    """
    row_of_push, row_of_body = _settings(config)
    pushes, own = np.full(batch, row_of_push), np.full((batch, bodies), row_of_body)
    for body, its in enumerate(each[:bodies]):
        own[:, body] = _settings(its)[1]
    for name, value in values.items():
        if name in OF_PUSHES:
            pushes[name] = value
        else:
            own[name] = value if value.ndim == 2 else value[:, None]
    return pushes, own


@lru_cache
def _settings(config: Hashable) -> tuple[ndarray, ndarray]:
    """Return one row of a push and one of a body, with a prior's settings."""
    pushes = np.array(tuple(getattr(config, name) for name in OF_PUSHES), PUSH_ROW)
    own = np.array(tuple(getattr(config, name) for name in OF_BODIES), BODY_ROW)
    return pushes, own


def check_values(values: Values, batch: int, bodies: int) -> None:
    """Check that values are of parameters, fit a batch of B scenes with N bodies, and are allowed.

    Raises `InvalidInputError`: naming what is not, and what is allowed.
    """
    for name, value in values.items():
        one = BY_NAME.get(name)
        if one is None:
            raise InvalidInputError(
                f"the planar prior has no parameter {name!r}; it has: {', '.join(BY_NAME)}"
            )
        shapes = [(batch,), (batch, bodies)] if one.scope == "body" else [(batch,)]
        if value.shape not in shapes:
            allowed = " or ".join(map(str, shapes))
            raise InvalidInputError(f"{name} has shape {allowed}, not {value.shape}")
        check_finite(name, value)
        wrong = (value < one.least) | (value > one.most)
        if wrong.any():
            where = tuple(int(index) for index in np.argwhere(wrong)[0])
            raise InvalidInputError(
                f"{name}{list(where)} is {value[where]}{one.unit and ' '}{one.unit};"
                f" allowed: {one.least:g} to {one.most:g}"
            )


def with_mass_ratio(scenes: Scenes, ratio: Float[ndarray, "R"] | float) -> Scenes:
    """Return scenes (B, N, 8) with masses of bodies 1 and on, over that of body 0, times a ratio.

    Half of the logarithm goes to body 0: the masses stay near those that networks were trained on.
    """
    if np.all(ratio == 1.0):
        return scenes
    root = np.sqrt(ratio)
    scaled = scenes.copy()
    scaled[..., MID, MASS] /= root
    scaled[..., MID + 1 :, MASS] *= np.asarray(root)[..., None]
    return scaled


AXES: Final = PlanarConfig(
    axes_yield=0.7406,
    yield_across=1.0,
    friction_scale=1.016,
    tool_friction=0.1212,
    disk_friction=0.121,
    tool_restitution=0.0179,
    disk_restitution=0.0017,
    foot_radius=0.7176,
    inertia=0.4797,
    middle_height=0.0178,
    tool_height=0.0196,
    disk_height=0.0196,
)
"""Fitted to 1,871 pushes of three-footed disks (docs/explanation/planar.md).

Bullet solves the friction of a foot along the world's x and y, each weighted by how hard the foot
is to move that way. That is no physics: a prior with it does not turn with the scene, but by
quarters of a turn and in the axes' mirrors. Against Bullet it errs a third as much.
"""

TEXTBOOK: Final = PlanarConfig(
    foot_radius=0.7,
    inertia=0.5,
    friction_scale=1.0,
    yield_across=1.0,
    tool_friction=0.12,
    disk_friction=0.12,
    tool_restitution=0.0,
    disk_restitution=0.0,
    middle_height=0.02,
    tool_height=0.02,
    disk_height=0.02,
)
"""Fitted to nothing: Coulomb's law under the feet of a uniform disk, pushed at half its height.

Frictions are the paper's nominal one, and nothing bounces.
"""
