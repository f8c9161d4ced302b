"""Blocks of Push-T as bodies, and where things there are in our frame.

Push-T counts in pixels, with y downwards, and the disk of gym-pusht has a radius of 15 pixels. A
pixel is as large here as makes that the radius of our tool. Then the whole room is in reach of the
arm. A pose of Push-T is that of the block's own origin; a state of ours is that of the centroid.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi
from typing import Any, Final, Self

import numpy as np

from sain_core.push import TOOL_RADIUS
from sain_core.scene import RADIUS, THETA, make_scene, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.solids import Prism, centroid, union_outline

DISK: Final = 15.0  # [px], radius of gym-pusht's disk: its add_circle
PIXEL: Final = TOOL_RADIUS / DISK  # [m]
MIDDLE: Final = 256.0  # [px], of the room
PLACE: Final = np.array([0.45, 0.0])  # [m], where its middle is on our table
WALLS: Final = (7.0, 504.0)  # [px], their faces: Push-T's add_segment
UNIT: Final = 30.0  # [px], `scale` in gym-pusht's add_tee: the bars' width
BAR: Final = ((-2.0, 0.0), (2.0, 0.0), (2.0, 1.0), (-2.0, 1.0))
STEM: Final = ((-0.5, 1.0), (0.5, 1.0), (0.5, 4.0), (-0.5, 4.0))
BLOCK_MASS: Final = 1.0  # [kg], any: nothing depends on it there


@dataclass(frozen=True)
class PushtShape(Prism):
    """A shape whose heading counts even where a turn leaves the outline unchanged."""

    symmetry = 2 * pi


@dataclass(frozen=True, eq=False)
class Block:
    """What can be pushed: an outline, and how its mass is spread.

    Attributes:
        shape: of its outline.
        radius: of the circumscribed circle [m].
        origin: (2,) of Push-T's pose, from the centroid, in the body's frame [m].
        mass_centre: (2,) likewise, of the centre of mass.
        gyration: radius of gyration about that centre [m].
    """

    shape: PushtShape
    radius: float
    origin: np.ndarray
    mass_centre: np.ndarray
    gyration: float

    @classmethod
    def of(
        cls, name: str, parts: Sequence[np.ndarray], mass_centre: Sequence[float], gyration: float
    ) -> Self:
        """Return the union of convex polygons (M, 2) about Push-T's origin, all in pixels."""
        flipped = [np.asarray(part) * [1.0, -1.0] for part in parts]
        rings = tuple(tuple(map(tuple, _counter_clockwise(part).tolist())) for part in flipped)
        outline = union_outline(rings, name)
        middle = centroid(outline)
        radius = float(np.hypot(*(outline - middle).T).max()) * PIXEL
        centre = PIXEL * (np.array(mass_centre) * [1.0, -1.0] - middle)
        shape = PushtShape.of(name, *rings)
        return cls(shape, radius, -PIXEL * middle, centre, gyration * PIXEL)

    @cached_property
    def table(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """What the kernels take: parts' corners, where they begin, mass centre, gyration [m]."""
        parts = self.shape.parts(self.radius)
        firsts = np.cumsum([0, *map(len, parts)])
        return np.concatenate(parts), firsts, self.mass_centre, self.gyration

    @property
    def symmetry(self) -> float:
        """The smallest turn [rad] that leaves the outline unchanged."""
        return Prism("", self.shape.corners, self.shape.polygons).symmetry

    @classmethod
    def read(cls, name: str, body: Any) -> Self:
        """Return the block that a body of pymunk is."""
        parts = [np.array(part.get_vertices()) for part in body.shapes]
        parts.sort(key=lambda part: tuple(part.mean(axis=0)))  # pymunk keeps them in a set
        return cls.of(name, parts, body.center_of_gravity, (body.moment / body.mass) ** 0.5)

    @cached_property
    def bodies(self) -> Bodies:
        """The one body of a scene."""
        return Bodies((self.shape,))

    def scene_of(self, pose: np.ndarray, mass: float = BLOCK_MASS) -> np.ndarray:
        """Return the scene (1, 8) of a pose (3,) of Push-T, at rest."""
        place = metres(pose[:2]) - _turned(self.origin, -pose[2])
        return make_scene(place[None], np.array([mass]), np.array([self.radius]), -pose[2:])

    def scene_at(self, pose: np.ndarray) -> np.ndarray:
        """Return the scene (1, 8) of a pose (3,) of the centroid in Push-T, at rest."""
        place, size = metres(pose[:2]), np.array([self.radius])
        return make_scene(place[None], np.array([BLOCK_MASS]), size, -pose[2:])

    @cached_property
    def outline(self) -> np.ndarray:
        """The corners (M, 2) [px] about the centroid, with y downwards."""
        return self.shape.outline(self.radius) / PIXEL * [1.0, -1.0]

    def pose_of(self, scene: np.ndarray) -> np.ndarray:
        """Return the pose (3,) in Push-T of a scene (1, 8), with an angle in (-pi, pi]."""
        heading, size = scene[0, THETA], scene[0, RADIUS] / self.radius
        place = scene[0, :2] + _turned(self.origin, heading) * size
        return np.append(pixels(place), wrap_angle(-heading))


def metres(places: np.ndarray) -> np.ndarray:
    """Return places (..., 2) [m] of pixels (..., 2)."""
    return PLACE + PIXEL * (places - MIDDLE) * [1.0, -1.0]


def pixels(places: np.ndarray) -> np.ndarray:
    """Return pixels (..., 2) of places (..., 2) [m]."""
    return MIDDLE + (places - PLACE) / PIXEL * [1.0, -1.0]


def _turned(place: np.ndarray, angle: float) -> np.ndarray:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin], [sin, cos]]) @ place


def _counter_clockwise(ring: np.ndarray) -> np.ndarray:
    after = np.roll(ring, -1, axis=0)
    return ring if (ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0]).sum() > 0 else ring[::-1]


# gym-pusht's T. Its mass is not spread evenly: both bars have that of the wider one, in both halves
# of the moment of inertia, which is taken about the origin and not about the centre of mass.
T: Final = Block.of(
    "pusht_t",
    [UNIT * np.array(BAR), UNIT * np.array(STEM)],
    (0.0, 1.5 * UNIT),
    UNIT * (2 * (16 + 1) / 12 + 2 * 0.25) ** 0.5,
)
SHAPE: Final = T.shape
