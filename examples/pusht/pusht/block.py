"""The T of gym-pusht as a body, and where things there are in our frame.

gym-pusht counts in pixels, with y downwards, and its disk has a radius of 15 pixels. A pixel is as
large here as makes that the radius of our tool. Then the whole room is in reach of the arm. A pose
of gym-pusht is that of the middle of the bar's outer side; a state of ours is that of the centroid.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from sain_core.push import TOOL_RADIUS
from sain_core.scene import RADIUS, THETA, make_scene, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.shape import Vector
from sain_core.shapes.solids import Prism, centroid

DISK: Final = 15.0  # [px], radius of the disk: gym-pusht's add_circle
PIXEL: Final = TOOL_RADIUS / DISK  # [m]
MIDDLE: Final = 256.0  # [px], of the room
PLACE: Final = np.array([0.45, 0.0])  # [m], where its middle is on our table
WALLS: Final = (7.0, 504.0)  # [px], their faces: gym-pusht's add_segment
UNIT: Final = 30.0  # [px], `scale` in gym-pusht's add_tee: the bars' width
BAR: Final = ((-2.0, -1.0), (2.0, -1.0), (2.0, 0.0), (-2.0, 0.0))
STEM: Final = ((-0.5, -4.0), (0.5, -4.0), (0.5, -1.0), (-0.5, -1.0))
CORNERS: Final = np.array(
    [(-2, 0), (-2, -1), (-0.5, -1), (-0.5, -4), (0.5, -4), (0.5, -1), (2, -1), (2, 0)], dtype=float
)  # counter-clockwise
CENTROID: Final = centroid(CORNERS)  # [units], from the middle of the bar's outer side
BLOCK_RADIUS: Final = float(np.hypot(*(CORNERS - CENTROID).T).max()) * UNIT * PIXEL  # [m]
BLOCK_MASS: Final = 1.0  # [kg], any: nothing depends on it there
GYRATION: Final = 0.73423  # [radii], fitted: the mass of gym-pusht's T is not spread evenly


@dataclass(frozen=True)
class PushtShape(Prism):
    """A T with the moment of inertia that it has in gym-pusht."""

    def inertia(self, mass: float, radius: float) -> Vector:
        """Return the moments [kg m^2]."""
        along_x, along_y, _ = super().inertia(mass, radius)
        return along_x, along_y, mass * (GYRATION * radius) ** 2


SHAPE: Final = PushtShape.of("pusht_t", BAR, STEM)
BODIES: Final = Bodies((SHAPE,))


def metres(places: np.ndarray) -> np.ndarray:
    """Return places (..., 2) [m] of pixels (..., 2)."""
    return PLACE + PIXEL * (places - MIDDLE) * [1.0, -1.0]


def pixels(places: np.ndarray) -> np.ndarray:
    """Return pixels (..., 2) of places (..., 2) [m]."""
    return MIDDLE + (places - PLACE) / PIXEL * [1.0, -1.0]


def scene_of(pose: np.ndarray, mass: float = BLOCK_MASS) -> np.ndarray:
    """Return the scene (1, 8) of a pose (3,) of gym-pusht, at rest."""
    place = metres(pose[:2]) + _turned(CENTROID, -pose[2]) * UNIT * PIXEL
    return make_scene(place[None], np.array([mass]), np.array([BLOCK_RADIUS]), -pose[2:])


def pose_of(scene: np.ndarray) -> np.ndarray:
    """Return the pose (3,) of gym-pusht of a scene (1, 8), with an angle in (-pi, pi]."""
    heading, size = scene[0, THETA], scene[0, RADIUS] / BLOCK_RADIUS * UNIT * PIXEL
    place = scene[0, :2] - _turned(CENTROID, heading) * size
    return np.append(pixels(place), wrap_angle(-heading))


def _turned(place: np.ndarray, angle: float) -> np.ndarray:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, -sin], [sin, cos]]) @ place
