"""What is to be solved: a scene, its bodies and a goal that fit together, in reach of an arm."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final, Self

import numpy as np

from sain_core.errors import InvalidInputError, UnreachableError
from sain_core.feasibility import Feasibility
from sain_core.goal import BodyPose, Goal
from sain_core.push import BODY, LENGTH, LOCATION, PATH
from sain_core.scene import (
    OVERLAP_TOLERANCE,
    RADIUS,
    check_states,
    move_apart,
    surface_gaps,
    unit,
    wrap_angle,
)
from sain_core.shapes.bodies import PAPER_DISKS, Bodies, check_bodies
from sain_core.shapes.shape import outline_of
from sain_core.types import Mask, PushArray, Pushes, Scene

SEEN_OVERLAP: Final = 0.02  # [m], deepest that bodies may seem to overlap
SIDES: Final = 72  # from which a goal is looked at
REFUSED_NEARBY: Final = np.array([0.15, 0.15, 0.02])  # [rad, rad, m], too like a refused push
SLIDE: Final = 0.03  # [m], how far bodies may slide on behind a tool that stops


@dataclass(frozen=True, eq=False)
class Problem:
    """A settled scene and a goal. `of` checks them; nobody else does."""

    scene: Scene  # (N, 8); disks that seemed to overlap a little just touch
    goal: Goal  # poses of bodies
    bodies: Bodies  # shapes and roles, of N bodies
    start: Scene  # (N, 8), the scene in which the goal was given
    feasibility: Feasibility  # what the arm can do
    refused: tuple[PushArray, ...] = ()  # (5,) each, pushes that were refused from this scene
    shortest: float = 0.0  # [m], a first push moves its body by more: less would be lost in noise

    @classmethod
    def of(
        cls,
        scene: Scene,
        goal: Goal,
        bodies: Bodies = PAPER_DISKS,
        start: Scene | None = None,
        feasibility: Feasibility = Feasibility(),
    ) -> Self:
        """Return the problem of a scene (N, 8) as observed; without a start, it is that, too.

        Raises `InvalidInputError`: a scene or goal that cannot exist, or that is about other
        bodies; `OffTableError`: the goal, or a body, is not on the table; `UnreachableError`: the
        arm cannot push a body to its pose from any side.
        """
        first, bodies = scene if start is None else start, bodies.fitted(len(scene))
        if len(bodies) != len(scene):
            raise InvalidInputError(
                f"the scene has {len(scene)} bodies; {len(bodies)} shapes are known"
            )
        table = feasibility.table
        if bodies.all_round:
            check_states(scene, table)
            deepest = -float(surface_gaps(scene).min(initial=np.inf))
            if deepest > OVERLAP_TOLERANCE:  # corners and tilted disks reach under each other
                scene = check_bodies(move_apart(scene) if deepest <= SEEN_OVERLAP else scene)
        else:
            check_bodies(scene, bodies, table, SEEN_OVERLAP)
        goal.check(scene, bodies, table)
        problem = cls(scene, goal, bodies, first, feasibility)
        problem.check_reach()
        return problem

    @cached_property
    def pushers(self) -> tuple[int, ...]:
        """What pushes the body of each pose: itself if the tool may touch it, or another body.

        That is the first one that the tool may push, rather one without a pose of its own.
        """
        pushable, busy = self.bodies.pushable, {*self.goal.wanted, *self.goal.keep}
        others = (*(body for body in pushable if body not in busy), *pushable)
        return tuple(body if body in pushable else others[0] for body in self.goal.wanted)

    def possible(self, pushes: Pushes) -> Mask:
        """Return which pushes (B, 5) can be carried out, and move their body."""
        scenes = np.broadcast_to(self.scene, (len(pushes), *self.scene.shape))
        ok = self.feasibility.mask(scenes, pushes, self.bodies)
        return np.asarray(ok & (pushes[:, LENGTH] > self.feasibility.limits.clearance))

    def permitted(self, pushes: Pushes) -> Mask:
        """Return which possible pushes (B, 5) are not too short, nor like those refused."""
        ok = self.possible(pushes)
        ok &= pushes[:, LENGTH] > self.feasibility.limits.clearance + self.shortest
        for one in self.refused:
            apart = np.abs(pushes - one)
            apart[:, LOCATION] = np.abs(wrap_angle(pushes[:, LOCATION] - one[LOCATION]))
            ok &= (apart[:, PATH] > REFUSED_NEARBY).any(axis=1) | (apart[:, BODY] > 0.0)
        return ok

    def check_reach(self) -> None:
        """Check that the arm can push the bodies to their poses, each from some side.

        The tool then stands behind the body, or behind another one that pushes it, but for as far
        as bodies slide on. A body that is there already needs no push.

        Raises `UnreachableError`: from no side.
        """
        away = self.goal.errors(self.scene, self.bodies)[0]
        for pose, pusher, apart in zip(self.goal.poses, self.pushers, away, strict=True):
            if apart > pose.tolerance:
                self._check_pose(pose, pusher)

    def _check_pose(self, pose: BodyPose, pusher: int) -> None:
        least, most = self.span(pose.body)
        if pusher != pose.body:
            narrow, wide = self.span(pusher)
            least, most = least + 2 * narrow, most + 2 * wide
        tool, reach = self.feasibility.limits.tool_radius, self.feasibility.reach
        sides = unit(np.linspace(-np.pi, np.pi, SIDES, endpoint=False))
        place = np.array([pose.x, pose.y])
        for behind in (least + tool, most + tool, most + tool + SLIDE):
            if reach.contains(place - behind * sides).any():
                return
        raise UnreachableError(
            f"the goal ({pose.x:.3f}, {pose.y:.3f}) m of body {pose.body} is out of reach: the tool"
            f" would have to stand {least + tool:.2f} m behind it, {reach.describe()}"
        )

    def span(self, body: int) -> tuple[float, float]:
        """Return the radii [m] of a body's inscribed and circumscribed circles."""
        shape, radius = self.bodies.shapes[body], float(self.scene[body, RADIUS])
        inscribed = 1.0 if shape.is_round else outline_of(shape).inscribed
        return inscribed * radius, shape.circumradius * radius
