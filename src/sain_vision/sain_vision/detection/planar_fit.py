"""The pose in the plane that brings points of a body onto the places where they are seen."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.scene import wrap_angle
from sain_core.types import Points

ROUNDS = 5  # of Gauss and Newton, which converge in two or three
ENOUGH = 1e-9  # [m], [rad]: a smaller step is the last one


@dataclass(frozen=True, eq=False)
class PlaneFit:
    """A pose in the plane by weighted least squares.

    Attributes:
        pose: (3,) x, y [m] and heading [rad].
        covariance: (3, 3), larger than the points' own where they do not fit together.
        misfit: root of the mean square of the errors, in standard deviations of the points.
    """

    pose: Float[ndarray, "3"]
    covariance: Float[ndarray, "3 3"]
    misfit: float


def fit_pose(points: Points, places: Points, covariances: Float[ndarray, "P 2 2"]) -> PlaneFit:
    """Return the pose of a body whose points (P, 2) are seen at places (P, 2), P >= 2.

    Errors of the places have these covariances [m^2], and are independent.
    """
    weights = np.linalg.inv(covariances)
    pose = _start(points, places)
    information = np.eye(3)
    for _ in range(ROUNDS):
        gradients, errors = _linearised(points, places, pose)
        weighted = np.einsum("pij,pjk->pik", weights, gradients)
        information = np.einsum("pji,pjk->ik", gradients, weighted)
        step = np.linalg.solve(information, np.einsum("pji,pj->i", weighted, errors))
        pose = pose + step
        if np.abs(step).max() < ENOUGH:
            break
    _, errors = _linearised(points, places, pose)
    squares = float(np.einsum("pi,pij,pj->", errors, weights, errors))
    free = 2 * len(points) - 3
    pose[2] = wrap_angle(pose[2])
    covariance = np.linalg.inv(information) * max(1.0, squares / free)
    return PlaneFit(pose, covariance, float(np.sqrt(squares / free)))


def _start(points: Points, places: Points) -> Float[ndarray, "3"]:
    """Return the pose with the least sum of squares, all places counting alike."""
    middle, target = points.mean(axis=0), places.mean(axis=0)
    one, other = points - middle, places - target
    cross = float((one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]).sum())
    heading = float(np.arctan2(cross, (one * other).sum()))
    return np.array([*(target - turned(middle[None], heading)[0]), heading])


def _linearised(
    points: Points, places: Points, pose: Float[ndarray, "3"]
) -> tuple[Float[ndarray, "P 2 3"], Points]:
    """Return the derivatives of the points' places by the pose, and the errors at it."""
    moved = turned(points, float(pose[2]))
    gradients = np.zeros((len(points), 2, 3))
    gradients[:, 0, 0] = gradients[:, 1, 1] = 1.0
    gradients[:, 0, 2], gradients[:, 1, 2] = -moved[:, 1], moved[:, 0]
    return gradients, places - moved - pose[:2]


def turned(points: Points, heading: float) -> Points:
    """Return points (P, 2) turned about the origin by an angle [rad]."""
    cosine, sine = np.cos(heading), np.sin(heading)
    return np.asarray(points @ np.array([[cosine, sine], [-sine, cosine]]))
