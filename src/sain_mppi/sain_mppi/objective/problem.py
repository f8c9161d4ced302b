"""What is to be solved: a scene, its bodies and a goal that fit together."""

from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np

from sain_core.errors import InvalidInputError
from sain_core.goal import Goal
from sain_core.scene import (
    OVERLAP_TOLERANCE,
    Table,
    check_scene,
    check_states,
    move_apart,
    surface_gaps,
)
from sain_core.shapes.bodies import PAPER_DISKS, Bodies, check_bodies
from sain_core.types import Scene

SEEN_OVERLAP: Final = 0.02  # [m], deepest that disks may seem to overlap


@dataclass(frozen=True, eq=False)
class Problem:
    """A settled scene and a goal. `of` checks them; nobody else does.

    Attributes:
        scene: (N, 8); disks that seemed to overlap a little just touch.
        goal: poses of bodies.
        bodies: shapes and roles, of N bodies.
        start: (N, 8), the scene in which the goal was given.
    """

    scene: Scene
    goal: Goal
    bodies: Bodies
    start: Scene

    @classmethod
    def of(
        cls,
        scene: Scene,
        goal: Goal,
        bodies: Bodies = PAPER_DISKS,
        start: Scene | None = None,
        table: Table = Table(),
    ) -> Self:
        """Return the problem of a scene (N, 8) as observed; without a start, it is that, too.

        Raises:
            InvalidInputError: a scene or goal that cannot exist, or that is about other bodies.
            OffTableError: the goal, or a body, is not on the table.
        """
        first, bodies = scene if start is None else start, bodies.fitted(len(scene))
        if len(bodies) != len(scene):
            raise InvalidInputError(
                f"the scene has {len(scene)} bodies; {len(bodies)} shapes are known"
            )
        if bodies.all_round:
            check_states(scene, table)
            if surface_gaps(scene).min(initial=np.inf) < -OVERLAP_TOLERANCE:
                scene = _parted(scene)
        else:
            check_bodies(scene, bodies, table, SEEN_OVERLAP)
        goal.check(scene, bodies, table)
        return cls(scene, goal, bodies, first)

    def after(self, scene: Scene) -> "Problem":
        """Return what is left of this problem in a scene (N, 8) that a model predicted."""
        return replace(self, scene=scene)


def _parted(scene: Scene) -> Scene:
    """Return an observed scene (N, 8) with disks that seem to overlap a little just touching.

    Seen from above, corners and tilted disks reach under each other, and cameras are not exact.

    Raises:
        InvalidInputError: disks that overlap by more than `SEEN_OVERLAP`.
    """
    deepest = -float(surface_gaps(scene).min())
    return check_scene(move_apart(scene) if deepest <= SEEN_OVERLAP else scene)
