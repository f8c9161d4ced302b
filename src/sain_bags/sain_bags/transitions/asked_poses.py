"""Poses that a recorded goal asks for, and how far bodies are from them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray

from sain_core.scene import POSITION, THETA
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene
from sain_core.wire import decode_goal_poses

HEADING, TOLERANCE, TURN = 2, 3, 4  # of the values


@dataclass(frozen=True, eq=False)
class AskedPoses:
    """P poses, each of one body."""

    bodies: tuple[int, ...]
    values: ndarray  # (P, 5), as `sain_core.wire.GOAL_POSE_FIELDS` names them; NaN: any heading
    shapes: Bodies | None  # None: not recorded, so disks

    def distances(self, scene: Scene) -> ndarray:
        """Return how far each body is from its place (P,) [m]; NaN: the scene has no such body."""
        return np.array(
            [
                np.hypot(*(scene[body, POSITION] - pose[:2])) if body < len(scene) else np.nan
                for body, pose in zip(self.bodies, self.values, strict=True)
            ]
        )

    def turns(self, scene: Scene) -> ndarray:
        """Return how far each body is turned from its heading (P,) [rad]; 0 where any will do."""
        return np.array(
            [
                self._turn(scene, body, float(pose[HEADING]))
                for body, pose in zip(self.bodies, self.values, strict=True)
            ]
        )

    def reached(self, scene: Scene) -> bool:
        """Tell whether all bodies are where they should be."""
        allowed = np.where(np.isnan(self.values[:, TURN]), np.inf, self.values[:, TURN])
        near = self.distances(scene) <= self.values[:, TOLERANCE]
        return bool((near & (self.turns(scene) <= allowed)).all())

    def _turn(self, scene: Scene, body: int, heading: float) -> float:
        if np.isnan(heading) or body >= len(scene):
            return 0.0
        known = self.shapes is not None and body < len(self.shapes)
        symmetry = self.shapes.shapes[body].symmetry if known and self.shapes else 0.0
        full = symmetry or 2 * np.pi
        return abs(float(np.mod(scene[body, THETA] - heading + full / 2, full) - full / 2))


def asked_poses(message: Any, shapes: Bodies | None) -> AskedPoses | None:
    """Return the poses of a ``Goal``; None: it has none, or is of an older definition."""
    bodies, values = decode_goal_poses(message)
    return AskedPoses(tuple(bodies.tolist()), values, shapes) if len(bodies) else None
