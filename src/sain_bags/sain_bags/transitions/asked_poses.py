"""Poses that a recorded goal asks for, how far bodies are from them, and bodies to be kept."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_core.scene import POSITION, THETA
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene
from sain_core.wire import decode_goal_poses

HEADING, TOLERANCE, TURN = 2, 3, 4  # of the values
KEEP_TOLERANCE: Final = 0.005  # [m], of `sain_mppi.search.poses`, where a goal gives none


@dataclass(frozen=True, eq=False)
class AskedPoses:
    """P poses, each of one body."""

    bodies: tuple[int, ...]
    values: ndarray  # (P, 5), as `sain_core.wire.GOAL_POSE_FIELDS` names them; NaN: any heading
    shapes: Bodies
    keep: tuple[int, ...] = ()  # bodies that may not be moved
    keep_tolerance: float = KEEP_TOLERANCE  # [m], by which these may be moved

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

    def moved(self, scene: Scene, start: Scene) -> ndarray:
        """Return how far the bodies to be kept are from where the goal found them (len(keep),)."""
        rows = [body for body in self.keep if body < len(scene)]
        return np.asarray(np.linalg.norm((scene - start)[rows, POSITION], axis=-1))

    def reached(self, scene: Scene, start: Scene) -> bool:
        """Tell whether all bodies are where they should be, given the scene of the goal's start."""
        allowed = np.where(np.isnan(self.values[:, TURN]), np.inf, self.values[:, TURN])
        near = self.distances(scene) <= self.values[:, TOLERANCE]
        kept = self.moved(scene, start) <= self.keep_tolerance
        return bool((near & (self.turns(scene) <= allowed)).all() and kept.all())

    def _turn(self, scene: Scene, body: int, heading: float) -> float:
        if np.isnan(heading) or body >= min(len(scene), len(self.shapes)):
            return 0.0
        full = self.shapes.shapes[body].symmetry or 2 * np.pi
        return abs(float(np.mod(scene[body, THETA] - heading + full / 2, full) - full / 2))


def asked_poses(message: Any, shapes: Bodies) -> AskedPoses | None:
    """Return the poses of a ``Goal``; None: it has none, or is of an older definition."""
    bodies, values = decode_goal_poses(message)
    if not len(bodies):
        return None
    return AskedPoses(tuple(bodies.tolist()), values, shapes, *kept_bodies(message))


def kept_bodies(message: Any) -> tuple[tuple[int, ...], float]:
    """Return the bodies that a ``Goal`` keeps, and by how far [m] these may be moved."""
    keep = tuple(int(body) for body in getattr(message, "keep", ()))
    return keep, float(getattr(message, "keep_tolerance", 0.0)) or KEEP_TOLERANCE
