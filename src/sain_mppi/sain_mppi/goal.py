"""The goal: where the target disk should come to rest."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import InvalidInputError, OffTableError, OutOfRangeError
from sain_core.scene import Table, is_settled, target_distance
from sain_core.types import Scene

Goal = Float[ndarray, "2"]


def check_goal(goal: Goal, table: Table) -> Goal:
    """Return the goal (2,) when a target can come to rest there.

    Raises:
        InvalidInputError: wrong shape, NaN or Inf.
        OffTableError: not on the table.
    """
    if goal.shape != (2,):
        raise InvalidInputError(f"a goal has shape (2,), not {goal.shape}")
    if not np.isfinite(goal).all():
        raise InvalidInputError(f"the goal is ({goal[0]}, {goal[1]}); both must be finite")
    if not table.contains(goal):
        raise OffTableError(
            f"the goal ({goal[0]:.3f}, {goal[1]:.3f}) m is off the table;"
            f" it covers {table.describe()}"
        )
    return goal


def check_tolerance(tolerance: float) -> float:
    """Return the tolerance [m] when it is a positive number.

    Raises:
        OutOfRangeError: it is not.
    """
    if not (np.isfinite(tolerance) and tolerance > 0):
        raise OutOfRangeError(f"the tolerance is {tolerance} m; it must be positive and finite")
    return tolerance


def goal_reached(scene: Scene, goal: Goal, tolerance: float) -> bool:
    """Tell whether the scene is settled with the target's centre within tolerance [m] of goal.

    Raises:
        OutOfRangeError: a tolerance that is not a positive number.
    """
    check_tolerance(tolerance)
    return bool(is_settled(scene) and target_distance(scene, goal) <= tolerance)
