"""Goals that are poses of one or several bodies."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import InvalidInputError, OffTableError
from sain_core.scene import POSITION, RADIUS, THETA, Table, is_settled
from sain_core.shapes.bodies import Bodies, overlap
from sain_core.shapes.disk import DISK
from sain_core.shapes.outline import outline_of
from sain_core.shapes.registry import get_shape
from sain_core.types import Angles, Scene, Scenes
from sain_mppi.search.goal import MOST_TURN, Goal, check_tolerance

Errors = Float[ndarray, "*B P"]  # of P poses

TOLERANCE: Final = 0.02
"""[m], of a pose that states none."""
TURN_PER_METRE: Final = 5.0
"""[rad/m], of a heading that states none: half of the distance at the rim of a body of 0.1 m."""
MOST_SHARED: Final = 1e-3  # [m], by which the bodies of two goals may overlap


@dataclass(frozen=True)
class BodyPose:
    """Where one body should come to rest.

    Attributes:
        body: its row in the scene.
        x: [m].
        y: [m].
        heading: [rad], modulo the symmetry of its shape; None: any.
        tolerance: [m], of the place.
        heading_tolerance: [rad].
    """

    body: int
    x: float
    y: float
    heading: float | None = None
    tolerance: float = TOLERANCE
    heading_tolerance: float = TURN_PER_METRE * TOLERANCE

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ("x", "y", "heading"):
            value = getattr(self, name)
            if value is not None and not np.isfinite(value):
                raise InvalidInputError(
                    f"{name} of the goal of body {self.body} is {value}; it must be finite"
                )
        check_tolerance(self.tolerance, f"tolerance of body {self.body}")
        turn = f"heading_tolerance of body {self.body}"
        check_tolerance(self.heading_tolerance, turn, MOST_TURN, "rad")


@dataclass(frozen=True)
class PoseGoal:
    """Poses of one or several bodies, and bodies that may not be moved.

    Attributes:
        poses: at most one for each body.
        keep: bodies that must stay where they are when the goal is given.
        keep_tolerance: [m], by which these may be moved.
    """

    poses: tuple[BodyPose, ...]
    keep: tuple[int, ...] = ()
    keep_tolerance: float = 0.005

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_tolerance(self.keep_tolerance, "keep_tolerance")

    @property
    def numbers(self) -> np.ndarray:
        """All numbers of the goal in one array; NaN for a heading that is free."""
        poses = [(p.body, p.x, p.y, np.nan if p.heading is None else p.heading) for p in self.poses]
        return np.array([*np.ravel(poses), *self.keep], dtype=np.float64)

    def check(self, scene: Scene, bodies: Bodies, table: Table) -> None:
        """Check that these bodies can have these poses.

        Raises:
            InvalidInputError: no pose, two for one body, a body that does not exist, a heading for
                a disk, a pose for a fixed body, poses that overlap each other or a fixed body.
            OffTableError: a pose off the table.
        """
        if not self.poses:
            raise InvalidInputError("the goal has no poses; give one or more")
        wanted = [pose.body for pose in self.poses]
        for pose in self.poses:
            self._check_pose(pose, wanted, scene, bodies, table)
        for body in self.keep:
            if not 0 <= body < len(bodies):
                raise InvalidInputError(
                    f"body {body} is to be kept; the scene has bodies 0 to {len(bodies) - 1}"
                )
            if body in wanted:
                raise InvalidInputError(f"body {body} is to be kept and to be moved to a pose")
        self._check_room(scene, bodies)

    def _check_pose(
        self, pose: BodyPose, wanted: list[int], scene: Scene, bodies: Bodies, table: Table
    ) -> None:
        if not 0 <= pose.body < len(bodies):
            raise InvalidInputError(
                f"a goal is given for body {pose.body}; the scene has bodies 0 to {len(bodies) - 1}"
            )
        shape = bodies.shapes[pose.body]
        if wanted.count(pose.body) > 1:
            raise InvalidInputError(
                f"body {pose.body} has {wanted.count(pose.body)} goals; allowed: 1"
            )
        if pose.heading is not None and shape.is_round:
            raise InvalidInputError(
                f"the goal of body {pose.body} has heading {pose.heading:.3f} rad; it is a disk and"
                " has none: leave the heading out"
            )
        if pose.body in bodies.fixed:
            raise InvalidInputError(f"body {pose.body} is fixed; it cannot be moved to a goal")
        if not table.contains(np.array([pose.x, pose.y])):
            raise OffTableError(
                f"the goal ({pose.x:.3f}, {pose.y:.3f}) m of body {pose.body} is off the table;"
                f" it covers {table.describe()}"
            )

    def _check_room(self, scene: Scene, bodies: Bodies) -> None:
        """Check that no two bodies have to overlap, of those whose places are given.

        A body may have any heading where none is given. It then covers its inscribed circle for
        sure, and no more is asked for.
        """
        placed, shapes = self.placed(scene), list(bodies.shapes)
        for pose in self.poses:
            if pose.heading is None and not shapes[pose.body].is_round:
                placed[pose.body, RADIUS] *= outline_of(shapes[pose.body]).inscribed
                shapes[pose.body] = get_shape(DISK)
        least = replace(bodies, shapes=tuple(shapes))
        given = [pose.body for pose in self.poses]
        names = dict.fromkeys(given, "goal of body") | dict.fromkeys(self.keep, "kept body")
        names |= dict.fromkeys(bodies.fixed, "fixed body")
        for index, body in enumerate(given):
            for other in (*given[:index], *self.keep, *bodies.fixed):
                deep = overlap(placed, least, body, other)
                if deep > MOST_SHARED:
                    raise InvalidInputError(
                        f"the goal of body {body} overlaps {names[other]} {other} by"
                        f" {1e3 * deep:.1f} mm"
                    )

    def placed(self, scene: Scene) -> Scene:
        """Return a scene (N, 8) with the bodies at their goals, all others where they are."""
        placed = scene.copy()
        for pose in self.poses:
            placed[pose.body, POSITION] = pose.x, pose.y
            if pose.heading is not None:
                placed[pose.body, THETA] = pose.heading
        return placed

    def errors(self, scenes: Scenes, bodies: Bodies) -> tuple[Errors, Errors]:
        """Return distances [m] and turns [rad] (..., P) of bodies to their poses; 0 where free."""
        apart = [
            np.hypot(scenes[..., pose.body, 0] - pose.x, scenes[..., pose.body, 1] - pose.y)
            for pose in self.poses
        ]
        turns = [heading_error(scenes[..., pose.body, THETA], pose, bodies) for pose in self.poses]
        return np.stack(apart, axis=-1), np.stack(turns, axis=-1)

    def reached(self, scene: Scene, start: Scene, bodies: Bodies) -> bool:
        """Tell whether a scene (N, 8) is settled and fulfils the goal that was given at `start`."""
        if not is_settled(scene):
            return False
        apart, turns = self.errors(scene, bodies)
        near = all(d <= pose.tolerance for d, pose in zip(apart, self.poses, strict=True))
        turned = all(abs(t) <= p.heading_tolerance for t, p in zip(turns, self.poses, strict=True))
        return near and turned and self.moved(scene, start) is None

    def moved(self, scene: Scene, start: Scene, slack: float = 0.0) -> int | None:
        """Return the first body that was to be kept and was moved, if any.

        It is when it is seen further off than its tolerance and the slack [m].
        """
        for body in self.keep:
            if np.hypot(*(scene - start)[body, POSITION]) > self.keep_tolerance + slack:
                return body
        return None


def goal_among(goal: Goal | PoseGoal, tolerance: float, count: int) -> Goal | PoseGoal:
    """Return a goal in a scene of so many bodies: of a single one, a place means that one."""
    if count > 1 or isinstance(goal, PoseGoal):
        return goal
    return PoseGoal((BodyPose(0, float(goal[0]), float(goal[1]), tolerance=tolerance),))


def heading_error(headings: Angles, pose: BodyPose, bodies: Bodies) -> Angles:
    """Return by how much headings (...,) [rad] differ from a pose's, modulo the symmetry."""
    if pose.heading is None or bodies.shapes[pose.body].is_round:
        return np.zeros_like(headings)
    turn = bodies.shapes[pose.body].symmetry
    return np.asarray(np.mod(headings - pose.heading + turn / 2, turn) - turn / 2)
