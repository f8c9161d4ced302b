"""The T of gym-pusht as a body of ours, and where things there are in our frame.

gym-pusht counts in pixels, with y downwards. A pixel is a millimetre here and y points upwards, so
that the T of the picture is the T of the world. A pose of gym-pusht is that of the middle of the
bar's outer side; a state of ours is that of the centroid.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.goal import BodyPose, Goal
from sain_core.scene import RADIUS, THETA, make_scene, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.shape import Vector
from sain_core.shapes.solids import Compound, centroid
from sain_core.types import Points, Scene

PIXEL: Final = 1e-3  # [m]
SIZE: Final = 512  # [pixels], of the square; targets of the agent lie in it
UNIT: Final = 30  # [pixels], `scale` in gym-pusht's add_tee: the bars' width
LENGTH: Final = 4  # [units], of the bar, and of the whole T
BAR: Final = ((-2.0, -1.0), (2.0, -1.0), (2.0, 0.0), (-2.0, 0.0))
STEM: Final = ((-0.5, -4.0), (0.5, -4.0), (0.5, -1.0), (-0.5, -1.0))
CORNERS: Final = np.array(
    [(-2, 0), (-2, -1), (-0.5, -1), (-0.5, -4), (0.5, -4), (0.5, -1), (2, -1), (2, 0)], dtype=float
)  # counter-clockwise
CENTROID: Final = centroid(CORNERS)  # [units], from the middle of the bar's outer side
BLOCK_RADIUS: Final = float(np.hypot(*(CORNERS - CENTROID).T).max()) * UNIT * PIXEL
BLOCK_MASS: Final = 1.0  # [kg], any: nothing depends on it there

Pose = Float[ndarray, "3"]  # of gym-pusht: x and y [pixels], angle [rad]


@dataclass(frozen=True)
class PushtShape(Compound):
    """A T whose mass need not be spread evenly.

    Attributes:
        gyration: radius of gyration about the centre of mass, in units of the state's radius; 0:
            that of a uniform T.
    """

    gyration: float = 0.0

    def inertia(self, mass: float, radius: float) -> Vector:
        """Return the moments [kg m^2]."""
        along_x, along_y, upright = super().inertia(mass, radius)
        if self.gyration > 0.0:
            upright = mass * (self.gyration * radius) ** 2
        return along_x, along_y, upright


def pusht_bodies(gyration: float = 0.0) -> Bodies:
    """Return the one body there is."""
    even = Compound.of("pusht_t", BAR, STEM)
    return Bodies((PushtShape("pusht_t", even.polygons, gyration),))


def scene_of(pose: Pose) -> Scene:
    """Return the scene (1, 8) of a pose (3,) of gym-pusht, at rest."""
    heading = -pose[2]
    cos, sin = np.cos(heading), np.sin(heading)
    away = np.array([[cos, -sin], [sin, cos]]) @ CENTROID * UNIT * PIXEL
    place = metres(pose[:2]) + away
    return make_scene(
        place[None], np.array([BLOCK_MASS]), np.array([BLOCK_RADIUS]), np.array([heading])
    )


def pose_of(scene: Scene) -> Pose:
    """Return the pose (3,) of gym-pusht of a scene (1, 8), with an angle in (-pi, pi]."""
    heading = scene[0, THETA]
    cos, sin = np.cos(heading), np.sin(heading)
    scale = scene[0, RADIUS] / BLOCK_RADIUS * UNIT * PIXEL
    place = scene[0, :2] - np.array([[cos, -sin], [sin, cos]]) @ CENTROID * scale
    return np.append(pixels(place), wrap_angle(-heading))


def metres(places: Points) -> Points:
    """Return places (..., 2) [m] of pixels (..., 2)."""
    return np.asarray(PIXEL * (places * [1.0, -1.0] + [0.0, SIZE]))


def pixels(places: Points) -> Points:
    """Return pixels (..., 2) of places (..., 2) [m]."""
    return np.asarray(places / PIXEL * [1.0, -1.0] + [0.0, SIZE])


def goal_of(pose: Pose, distance: float, turn: float) -> Goal:
    """Return the goal that a pose (3,) of gym-pusht is, with tolerances [m] and [rad]."""
    x, y, heading = (float(scene_of(pose)[0, column]) for column in (0, 1, THETA))
    return Goal((BodyPose(0, x, y, heading, distance, turn),))
