"""Reasons to refuse a push or a scene: each check raises an error with value and allowed range."""

from typing import Final

import numpy as np

from sain_core.errors import BlockedError, InvalidInputError, UnreachableError
from sain_core.feasibility import Feasibility, reachable, start_gap, tool_gap
from sain_core.push import PUSH_SIZE
from sain_core.scene import MASS, RADIUS
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import PushArray, Scene
from sain_sim.world.parameters import WorldParameters

MATCH_TOLERANCE: Final = 1e-6  # [kg] or [m]


def check_same_bodies(scene: Scene, parameters: WorldParameters) -> None:
    """Raise `InvalidInputError` unless a scene (N, 8) has the masses and radii of a world."""
    if len(scene) != parameters.count:
        raise InvalidInputError(
            f"the scene has {len(scene)} bodies; this world has {parameters.count}"
        )
    for column, name, values in (
        (MASS, "mass", parameters.masses),
        (RADIUS, "radius", parameters.radii),
    ):
        wrong = np.abs(scene[:, column] - values) > MATCH_TOLERANCE
        if wrong.any():
            disk = int(np.argmax(wrong))
            raise InvalidInputError(
                f"{name} of body {disk} is {scene[disk, column]:.6g} in the scene and"
                f" {values[disk]:.6g} in this world; they must be the same"
            )


def check_reach(
    scene: Scene, push: PushArray, feasibility: Feasibility, bodies: Bodies = PAPER_DISKS
) -> None:
    """Raise `UnreachableError` when the tool's way leaves the reach."""
    reach = feasibility.reach
    if not reachable(scene, push, feasibility.limits, reach, bodies):
        location, angle, length = push[:PUSH_SIZE]
        raise UnreachableError(
            f"the tool's way for push ({location:.3f}, {angle:.3f}, {length:.3f}) leaves the"
            f" arm's reach of {reach.inner} to {reach.outer} m from the base,"
            f" |bearing| <= {reach.max_bearing} rad"
        )


def check_gap(
    scene: Scene, push: PushArray, feasibility: Feasibility, bodies: Bodies = PAPER_DISKS
) -> None:
    """Raise `BlockedError` when the tool cannot start, or another body is in its way."""
    room = float(start_gap(scene, push, feasibility.limits, bodies))
    if room < 0.0:
        raise BlockedError(
            f"the tool would start {-1e3 * room:.1f} mm inside the body that it is to push:"
            " the point is too near an inner corner of the outline"
        )
    gap = float(tool_gap(scene, push, feasibility.limits, bodies))
    if gap < feasibility.tool_margin:
        raise BlockedError(
            f"the tool would pass another body with a gap of {1e3 * gap:.1f} mm;"
            f" at least {1e3 * feasibility.tool_margin:g} mm is needed"
        )
