"""The goal: where the target disk should come to rest."""

from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import (
    InvalidInputError,
    OffTableError,
    OutOfRangeError,
    UnreachableError,
)
from sain_core.feasibility import Feasibility
from sain_core.scene import MID, RADIUS, TARGET, Table, is_settled, target_distance, unit
from sain_core.types import Scene

Goal = Float[ndarray, "2"]

SIDES: Final = 72  # from which a goal is looked at
SLIDE: Final = 0.03  # [m], how far disks may slide on behind a tool that stops
MOST_TOLERANCE: Final = 1.0  # [m], less than a table is wide
MOST_TURN: Final = 5.0  # [rad]; any heading is nearer than pi


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


def check_in_reach(goal: Goal, scene: Scene, feasibility: Feasibility) -> None:
    """Check that the arm can push the target of a scene (N, 8) to a goal (2,), from some side.

    The tool then stands behind the mid disk, which stands behind the target, but for as far as
    disks slide on.

    Raises:
        UnreachableError: from no side.
    """
    limits = feasibility.limits
    behind = scene[TARGET, RADIUS] + 2 * scene[MID, RADIUS] + limits.tool_radius
    bearing = np.linspace(-np.pi, np.pi, SIDES, endpoint=False)
    for slide in (0.0, SLIDE):
        if feasibility.reach.contains(goal - (behind + slide) * unit(bearing)).any():
            return
    reach = feasibility.reach
    raise UnreachableError(
        f"the goal ({goal[0]:.3f}, {goal[1]:.3f}) m is out of reach: the tool would have to stand"
        f" {behind:.2f} m behind it, {reach.inner} to {reach.outer} m from the arm's base"
    )


def check_tolerance(
    tolerance: float, what: str = "the tolerance", most: float = MOST_TOLERANCE, unit: str = "m"
) -> float:
    """Return a tolerance when it is positive, and not too large to mean anything.

    Raises:
        OutOfRangeError: it is not, or NaN.
    """
    if not 0.0 < tolerance <= most:
        raise OutOfRangeError(
            f"{what} is {tolerance} {unit}; allowed: above 0, up to {most:g} {unit}"
        )
    return tolerance


def goal_reached(scene: Scene, goal: Goal, tolerance: float) -> bool:
    """Tell whether the scene is settled with the target's centre within tolerance [m] of goal."""
    return bool(is_settled(scene) and target_distance(scene, goal) <= tolerance)
