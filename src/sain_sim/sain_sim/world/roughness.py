"""The effects of a rough world, which the nominal model lacks. All are off by default.

`draw_roughness` draws them for a lab, whose table, disks and tool stay the same in all episodes.
docs/explanation/worlds.md states the size of each effect, and its reason. Errors are drawn for
disks. A shape of the library has its own feet, and each of these is off by as much as that foot of
a disk: in bearing, and in distance as a share.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from math import asin, cos, pi, radians, sin, sqrt
from typing import Any, Final

import numpy as np
from shapely import MultiPoint, Polygon

from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.seeding import generator
from sain_core.shapes.shape import FOOT_BEARINGS, REGULAR_FEET, Pair, Shape
from sain_sim.arm.panda import ArmConfig

Feet = tuple[Pair, Pair, Pair]
Wave = tuple[float, float, float]

MASS_OFFSET: Final = (0.08, 0.15)  # [radii], from the centre to the centre of mass
FOOT_DISTANCE: Final = (0.6, 0.8)  # [radii]; a regular foot stands at 0.7
FOOT_TURN: Final = radians(15)  # either way from its regular bearing
WAVES: Final = 3  # of which the patches are made
WAVE_LENGTH: Final = (0.2, 0.4)  # [m], patches are half as wide
PATCH_DEPTH: Final = 0.7  # friction is between exp(-0.7) and exp(0.7) of its mean
GRAIN: Final = (0.6, 0.8)  # friction along y over friction along x
TILT: Final = (radians(0.5), radians(1.0))
TOOL_STIFFNESS: Final = (2000.0, 3000.0)  # [N/m], the upper end of Franka's Cartesian impedance
STIFF_TOOL: Final = 20_000.0  # [N/m], where only torques are limited: 1 mm at 20 N
RIM_FRICTION: Final = (0.2, 0.4)  # the prior assumes 0.12

RIMS: Final = "rims"
MOVED_FEET: Final = "feet"
SHARES: Final = (1.0, 0.7, 0.5, 0.35, 0.2, 0.1, 0.0)  # of the errors, the first that fits
LEAST_LOAD: Final = 0.1  # of the weight, on each foot; a third on each is even


@dataclass(frozen=True)
class Roughness(Config):
    """The values of all effects in one world; the defaults are a smooth world."""

    mass_offsets: tuple[Pair, ...] = option(
        (), "centre of mass in each disk's frame, in radii; none: in the middle"
    )
    feet: tuple[Feet, ...] = option(
        (), "each disk's feet in its frame: distance in radii, bearing [rad]; none: regular"
    )
    patches: tuple[Wave, ...] = option(
        (), "waves of the table's friction: along x and y [rad/m], phase [rad]; none: even"
    )
    grain: float = option(
        1.0, "friction along the world's y over friction along x", minimum=0.1, maximum=10.0
    )
    tilt: Pair = option(
        (0.0, 0.0), "how far the table goes down towards +x and +y", unit="rad", minimum=-0.1,
        maximum=0.1,
    )  # fmt: skip
    tool_stiffness: float = option(
        0.0, "stiffness of the spring that holds the stick; 0: rigid", unit="N/m", minimum=0.0
    )
    stock_joints: bool = option(False, "joints give the tool no more than Franka's torques")

    def __post_init__(self) -> None:
        """Check the fields, and that no disk tips over."""
        super().__post_init__()
        for disk, feet in enumerate(self.feet):
            offset = self.mass_offsets[disk] if disk < len(self.mass_offsets) else (0.0, 0.0)
            if not _stands(feet, offset):
                raise ConfigError(
                    f"disk {disk} would tip over: its centre of mass {offset} is not between its"
                    f" feet {feet}"
                )

    def check_count(self, count: int) -> None:
        """Check that values for single disks are given for each of N = count disks."""
        for name in ("mass_offsets", "feet"):
            given = len(getattr(self, name))
            if given not in (0, count):
                raise ConfigError(f"Roughness.{name} is about {given} disks, the world has {count}")

    def mass_offset(self, disk: int) -> Pair:
        """Return a disk's centre of mass in its frame [radii]."""
        return self.mass_offsets[disk] if self.mass_offsets else (0.0, 0.0)

    def arm(self, config: ArmConfig) -> ArmConfig:
        """Return how the arm of such a world is built and controlled."""
        if self.tool_stiffness or self.stock_joints:
            config = replace(config, tool_stiffness=self.tool_stiffness or STIFF_TOOL)
        return replace(config, tool_torque_scale=1.0) if self.stock_joints else config

    def friction_factor(self, x: float, y: float) -> float:
        """Return the friction at a place on the table [m], over its mean; 1 without patches."""
        height = 0.0
        for along_x, along_y, phase in self.patches:
            height += cos(along_x * x + along_y * y + phase)
        return float(np.exp(PATCH_DEPTH * height / max(len(self.patches), 1)))

    def gravity(self, strength: float) -> tuple[float, float, float]:
        """Return gravity [m/s^2] in the frame of the tilted table."""
        x, y = sin(self.tilt[0]), sin(self.tilt[1])
        return strength * x, strength * y, -strength * sqrt(1.0 - x * x - y * y)

    @property
    def effects(self) -> tuple[str, ...]:
        """The effects that are on; friction of rims is not part of this."""
        on = self.arrays()
        return tuple(effect for effect, (field, _) in _DRAW.items() if field in on)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the effects that are on, as arrays for a data set."""
        return {
            item.name: np.asarray(getattr(self, item.name))
            for item in fields(self)
            if getattr(self, item.name) != item.default
        }


SMOOTH: Final = Roughness()


def _mass_offsets(random: np.random.Generator, count: int) -> tuple[Pair, ...]:
    drawn = [(random.uniform(*MASS_OFFSET), random.uniform(-pi, pi)) for _ in range(count)]
    return tuple((away * cos(turn), away * sin(turn)) for away, turn in drawn)


def _feet(random: np.random.Generator, count: int) -> tuple[tuple[Pair, ...], ...]:
    def foot(regular: float) -> Pair:
        turn = random.uniform(-FOOT_TURN, FOOT_TURN)
        return random.uniform(*FOOT_DISTANCE), regular + turn

    return tuple(tuple(map(foot, FOOT_BEARINGS)) for _ in range(count))


def _patches(random: np.random.Generator, count: int) -> tuple[Wave, ...]:
    number = 2 * pi / random.uniform(*WAVE_LENGTH, WAVES)
    bearing, phase = random.uniform(-pi, pi, (2, WAVES))
    waves = np.stack([number * np.cos(bearing), number * np.sin(bearing), phase], axis=-1)
    return tuple(tuple(wave) for wave in waves.tolist())


def _tilt(random: np.random.Generator, count: int) -> Pair:
    steep, bearing = sin(random.uniform(*TILT)), random.uniform(-pi, pi)
    return asin(steep * cos(bearing)), asin(steep * sin(bearing))


# of each effect the field of `Roughness`, and how its value is drawn for so many disks
_DRAW: Final[dict[str, tuple[str, Callable[[np.random.Generator, int], Any]]]] = {
    "mass": ("mass_offsets", _mass_offsets),
    MOVED_FEET: ("feet", _feet),
    "patches": ("patches", _patches),
    "direction": ("grain", lambda random, count: random.uniform(*GRAIN)),
    "tilt": ("tilt", _tilt),
    "tool": ("tool_stiffness", lambda random, count: random.uniform(*TOOL_STIFFNESS)),
    "torque": ("stock_joints", lambda random, count: True),
}
EFFECTS: Final = (*_DRAW, RIMS)


def draw_roughness(lab: int, effects: tuple[str, ...], count: int) -> Roughness:
    """Draw the effects of a lab with N = count disks.

    Each has a random stream of its own, so it is the same alone and among others.
    """
    values = {}
    for effect in effects:
        if effect in _DRAW:
            field, draw = _DRAW[effect]
            values[field] = draw(generator(lab, "lab", effect), count)
    return Roughness(**values)


def _stands(feet: Feet, mass_offset: Pair) -> bool:
    """Return whether the centre of mass is between the feet, which go around anticlockwise."""
    px, py = mass_offset
    places = [(share * cos(turn), share * sin(turn)) for share, turn in feet]
    ends = zip(places, (*places[1:], places[0]), strict=True)
    return all((bx - ax) * (py - ay) > (by - ay) * (px - ax) for (ax, ay), (bx, by) in ends)


def fit_shapes(roughness: Roughness, shapes: tuple[Shape, ...]) -> Roughness:
    """Return the errors of disks as those of bodies with these shapes.

    Bodies on a disk's regular feet keep theirs. For others both errors are made
    smaller, by the same share, until all feet are below the body and each carries a part of it.
    """
    regular = (REGULAR_FEET,) * len(shapes)
    made = [
        (feet, roughness.mass_offset(body))
        if shape.feet == REGULAR_FEET
        else _fit(shape, feet, roughness.mass_offset(body))
        for body, (shape, feet) in enumerate(zip(shapes, roughness.feet or regular, strict=True))
    ]
    feet, offsets = zip(*made, strict=True)
    return replace(
        roughness,
        feet=feet if roughness.feet else (),
        mass_offsets=offsets if roughness.mass_offsets else (),
    )


def _fit(shape: Shape, of_disk: tuple[Pair, ...], offset: Pair) -> tuple[Feet, Pair]:
    """Return feet and centre of mass of a shape, by those of a disk."""
    outline = Polygon(shape.outline(1.0)).buffer(1e-9)
    for share in SHARES:
        feet = _moved(shape, of_disk, share)
        mass = share * offset[0], share * offset[1]
        places = [(away * cos(bearing), away * sin(bearing)) for away, bearing in feet]
        if outline.covers(MultiPoint(places)) and _least_load(places, mass) >= LEAST_LOAD:
            break
    return feet, mass


def _moved(shape: Shape, of_disk: tuple[Pair, ...], share: float) -> Feet:
    """Return a shape's feet, anticlockwise, off by a share of the errors of a disk's."""
    own = sorted(shape.feet, key=lambda foot: foot[1])
    first, second, third = (
        (away * (1.0 + share * (far / regular - 1.0)), bearing + share * (turned - right))
        for (away, bearing), (far, turned), (regular, right) in zip(
            own, of_disk, REGULAR_FEET, strict=True
        )
    )
    return first, second, third


def _least_load(feet: list[Pair], mass: Pair) -> float:
    """Return the share of the weight on the foot of three that carries least."""
    places = np.column_stack([np.ones(3), feet])
    return float(np.linalg.solve(places.T, [1.0, *mass]).min())
