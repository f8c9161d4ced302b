"""The values of all effects that the nominal model lacks. All are off by default.

`sain_sim.world.truth` draws them for a lab. Errors are drawn for disks. A shape of the library
has its own feet, and each of these is off by as much as that foot of a disk: in bearing, and in
distance as a share.
"""

from dataclasses import dataclass, fields, replace
from hashlib import sha256
from math import cos, sin, sqrt
from typing import Final, NamedTuple

import numpy as np
from shapely import MultiPoint, Polygon

from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.randomness import generator
from sain_core.shapes.shape import REGULAR_FEET, Pair, Shape
from sain_core.shapes.solids import even_supports
from sain_core.types import Points, Scalars

Feet = tuple[Pair, Pair, Pair]
Wave = tuple[float, float, float]
Pressure = tuple[float, ...]  # factor on the supports' distance from the middle, then their weights

PATCH_DEPTH: Final = 0.7  # friction is between exp(-0.7) and exp(0.7) of its mean
STIFF_TOOL: Final = 20_000.0  # [N/m], where only torques are limited: 1 mm at 20 N
QUIET: Final = (0.0, 0.0)
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
    patch_depth: float = option(
        PATCH_DEPTH,
        "logarithm of the friction over its mean, where it is largest",
        minimum=0.0,
        maximum=5.0,
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
    pressures: tuple[Pressure, ...] = option(
        (), "of each flat bottom: factor on its supports' distances, then their weights; none: even"
    )
    contact_times: Pair = option(
        QUIET, "time constants of contacts of the tool, and of two bodies; 0: rigid", unit="s",
        minimum=0.0, maximum=0.1,
    )  # fmt: skip
    tool_offset: Pair = option(
        QUIET, "the tool's place less the commanded one, in the world", unit="m", minimum=-0.01,
        maximum=0.01,
    )  # fmt: skip
    noise: Pair = option(
        QUIET,
        "of each push: deviation of the tool's place [m], along x and y, and of the logarithm of"
        " the friction below each support",
        minimum=0.0,
        maximum=1.0,
    )
    repeat: int = option(0, "number of the draw of noise for equal pushes", minimum=0)

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
        for name in ("mass_offsets", "feet", "pressures"):
            given = len(getattr(self, name))
            if given not in (0, count):
                raise ConfigError(f"Roughness.{name} is about {given} disks, the world has {count}")

    def mass_offset(self, disk: int) -> Pair:
        """Return a disk's centre of mass in its frame [radii]."""
        return self.mass_offsets[disk] if self.mass_offsets else (0.0, 0.0)

    @property
    def spring(self) -> float:
        """Stiffness [N/m] of the spring that holds the stick; 0: it is rigid."""
        return self.tool_stiffness or (STIFF_TOOL if self.stock_joints else 0.0)

    def friction_factor(self, x: float, y: float) -> float:
        """Return the friction at a place on the table [m], over its mean; 1 without patches."""
        height = 0.0
        for along_x, along_y, phase in self.patches:
            height += cos(along_x * x + along_y * y + phase)
        return float(np.exp(self.patch_depth * height / max(len(self.patches), 1)))

    def gravity(self, strength: float) -> tuple[float, float, float]:
        """Return gravity [m/s^2] in the frame of the tilted table."""
        x, y = sin(self.tilt[0]), sin(self.tilt[1])
        return strength * x, strength * y, -strength * sqrt(1.0 - x * x - y * y)

    def supports(self, disk: int, shape: Shape) -> tuple[Points, Scalars]:
        """Return the points (F, 2) [radii] that carry a flat bottom, and their weights (F,)."""
        points = even_supports(shape)
        if not self.pressures:
            return points, np.full(len(points), 1.0 / len(points))
        spread, *weights = self.pressures[disk]
        return spread * points, np.array(weights) / sum(weights)

    def disturbance(self, before: bytes, supports: int) -> "Disturbance":
        """Draw the noise of one push with so many supports, by the bytes of what it begins with."""
        place, slip = self.noise
        random = generator(0, "noise", self.repeat, sha256(before).hexdigest())
        x, y = random.normal(0.0, place, 2) + self.tool_offset
        return Disturbance((float(x), float(y)), np.exp(random.normal(0.0, slip, supports)))

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the effects that are on, as arrays for a data set."""
        return {
            item.name: np.asarray(getattr(self, item.name))
            for item in fields(self)
            if getattr(self, item.name) != item.default
        }


SMOOTH: Final = Roughness()


class Disturbance(NamedTuple):
    """The noise of one push.

    Attributes:
        tool: its place less the commanded one [m].
        supports: factors (F,) on the friction below all supports, body after body.
    """

    tool: Pair
    supports: Scalars


def _stands(feet: Feet, mass_offset: Pair) -> bool:
    """Return whether the centre of mass is between the feet, which go around anticlockwise."""
    px, py = mass_offset
    places = [(share * cos(turn), share * sin(turn)) for share, turn in feet]
    ends = zip(places, (*places[1:], places[0]), strict=True)
    return all((bx - ax) * (py - ay) > (by - ay) * (px - ax) for (ax, ay), (bx, by) in ends)


def fit_shapes(roughness: Roughness, shapes: tuple[Shape, ...]) -> Roughness:
    """Return the errors of disks as those of bodies with these shapes.

    Bodies on a disk's regular feet keep theirs. For others all errors are made smaller, by the same
    share, until all supports are below the body and each carries a part of it.
    """
    if all(shape.lies_flat for shape in shapes):
        return _fit_flat(roughness, shapes)
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


def _fit_flat(roughness: Roughness, shapes: tuple[Shape, ...]) -> Roughness:
    """Return the errors of disks as those of flat bodies with these shapes.

    Even supports may lie in a notch of an outline, so it is its convex hull that holds them.
    """
    pressures, offsets = [], []
    for body, shape in enumerate(shapes):
        outline = Polygon(shape.outline(1.0)).convex_hull.buffer(1e-9)
        for share in SHARES:
            spread, *weights = roughness.pressures[body] if roughness.pressures else (1.0,)
            pressure = (1.0 + share * (spread - 1.0), *weights)
            x, y = roughness.mass_offset(body)
            made = replace(roughness, pressures=(pressure,) if weights else (), mass_offsets=())
            points, shares = made.supports(0, shape)
            if outline.covers(MultiPoint(points)) and _bears(
                points, shares, (share * x, share * y)
            ):
                break
        pressures.append(pressure)
        offsets.append((share * x, share * y))
    return replace(
        roughness,
        pressures=tuple(pressures) if roughness.pressures else (),
        mass_offsets=tuple(offsets) if roughness.mass_offsets else (),
    )


def _bears(points: Points, weights: Scalars, mass: Pair) -> bool:
    """Return whether each of elastic supports (F, 2) carries a part of a body."""
    places = np.column_stack([np.ones(len(points)), points])
    sinking = np.linalg.solve(places.T @ (weights[:, None] * places), [1.0, *mass])
    return bool((places @ sinking).min() > 0.0)


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
