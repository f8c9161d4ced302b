"""What is to be solved: a scene, its bodies and a goal that fit together, in reach of an arm."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Self

import numpy as np

from sain_core.errors import InvalidInputError, SainError, UnreachableError
from sain_core.feasibility import Feasibility, Stroke
from sain_core.goal import MOST_SHARED, Goal
from sain_core.push import BODY, LENGTH, LOCATION, PATH, SPEED
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
from sain_core.types import Mask, Place, Points, PushArray, Pushes, Scene

SEEN_OVERLAP: Final = 0.02  # [m], deepest that bodies may seem to overlap
SIDES: Final = 72  # from which a goal is looked at
SLOWER: Final = 0.75  # share of the speed of a refused push, below which it may be tried again
REFUSED_NEARBY: Final = np.array([0.15, 0.15, 0.02])  # [rad, rad, m], too like a refused push
SLIDE: Final = 0.03  # [m], how far bodies may slide on behind a tool that stops
COARSE: Final = 0.01  # [m] between places of the table that are tried as goals
FINE: Final = 0.001  # [m], the same about the nearest of them
DECIMALS: Final = 3  # of a place in a message
AT_ONCE: Final = 200  # places that are tried for reach in one go


@dataclass(frozen=True, eq=False)
class Problem:
    """A settled scene and a goal. `of` checks them; nobody else does."""

    scene: Scene  # (N, 8); disks that seemed to overlap a little just touch
    goal: Goal  # poses of bodies
    bodies: Bodies  # shapes and roles, of N bodies
    start: Scene  # (N, 8), the scene in which the goal was given
    feasibility: Feasibility  # what the arm can do
    tool: Place | None = None  # (2,) [m], where the tool was last; None: it is not known
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
        arm cannot push a body to its pose from any side. See `check_goal`.
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
        problem = cls(scene, goal, bodies, first, feasibility)
        problem.check_goal()
        return problem

    @cached_property
    def pushers(self) -> tuple[int, ...]:
        """What pushes the body of each pose: itself if the tool may touch it, or another body.

        That is the first one that the tool may push, rather one without a pose of its own.
        """
        pushable, busy = self.bodies.pushable, {*self.goal.wanted, *self.goal.keep}
        others = (*(body for body in pushable if body not in busy), *pushable)
        return tuple(body if body in pushable else others[0] for body in self.goal.wanted)

    def tool_after(self, push: PushArray) -> Place:
        """Return where (2,) [m] the tool ends a push (5,) of this scene."""
        return Stroke.of_push(self.scene, push, self.feasibility.limits, self.bodies).end

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
            slower = pushes[:, SPEED] < SLOWER * one[SPEED]  # a joint may have been too slow
            other = (apart[:, PATH] > REFUSED_NEARBY).any(axis=1) | (apart[:, BODY] > 0.0)
            ok &= other | slower
        return ok

    def check_goal(self) -> None:
        """Check that the arm can bring the bodies to their poses; raises as `of`.

        The message names the nearest places that are possible, with the same headings, if any are.
        """
        self.goal.check_bodies(self.bodies)
        try:
            self._check_places()
        except SainError as error:
            raise type(error)(f"{error}{self._describe_nearest()}") from None

    def _check_places(self, most: float = MOST_SHARED) -> None:
        self.goal.check_places(self.feasibility.table)
        self.goal.check_room(self.scene, self.bodies, most)
        self._check_reach()

    def _check_reach(self) -> None:
        """Check that the arm can push the bodies to their poses, each from some side.

        A body that is there already needs no push. Raises `UnreachableError`: from no side.
        """
        away = self.goal.errors(self.scene, self.bodies)[0]
        for number, (pose, apart) in enumerate(zip(self.goal.poses, away, strict=True)):
            if apart > pose.tolerance and not self._in_reach(number, self.goal.places[number]):
                raise UnreachableError(
                    f"the goal ({pose.x:.3f}, {pose.y:.3f}) m of body {pose.body} is out of reach:"
                    f" the tool would have to stand {self._behind(number)[0]:.2f} m behind it,"
                    f" {self.feasibility.reach.describe()}"
                )

    def _behind(self, number: int) -> tuple[float, float, float]:
        """Return how far [m] the tool may stand behind the place of a pose, while it pushes.

        It is behind the body, or behind another one that pushes it, but for as far as bodies slide.
        """
        body, pusher = self.goal.wanted[number], self.pushers[number]
        least, most = self.span(body)
        if pusher != body:
            narrow, wide = self.span(pusher)
            least, most = least + 2 * narrow, most + 2 * wide
        tool = self.feasibility.limits.tool_radius
        return least + tool, most + tool, most + tool + SLIDE

    def _in_reach(self, number: int, places: Points) -> Mask:
        """Tell at which places (..., 2) the tool can push the body of a pose, from some side."""
        sides = unit(np.linspace(-np.pi, np.pi, SIDES, endpoint=False))
        behind = np.array(self._behind(number))[:, None, None] * sides
        stands = places[..., None, None, :] - behind
        return np.asarray(self.feasibility.reach.contains(stands).any(axis=(-2, -1)))

    def _describe_nearest(self) -> str:
        """Return in words the nearest possible places of the poses; empty: none was found.

        Each pose that is not possible with those before it is moved.
        """
        nearest, moved = self, list[str]()
        for number, pose in enumerate(self.goal.poses):
            if not nearest._allows(number, most=MOST_SHARED):
                place = nearest._nearest_place(number)
                if place is None:
                    return ""
                nearest = nearest._with_place(number, place)
                moved.append(f"({place[0]:.3f}, {place[1]:.3f}) m of body {pose.body}")
        return f"; the nearest that is possible is {', '.join(moved)}"

    def _nearest_place(self, number: int) -> Place | None:
        """Return the possible place that is nearest to that of a pose, to the millimetre.

        The table is searched in steps of `COARSE`; from the nearest place on, its surroundings.
        """
        table = self.feasibility.table
        x, y = (
            np.arange(np.ceil(low / COARSE), high / COARSE) * COARSE
            for low, high in ((table.x_min, table.x_max), (table.y_min, table.y_max))
        )
        best: Place | None = None
        places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        while (nearer := self._first_possible(number, places, best)) is not None:
            best = nearer
            step = np.arange(-COARSE, COARSE + FINE / 2, FINE)
            places = best + np.stack(np.meshgrid(step, step), axis=-1).reshape(-1, 2)
        return best

    def _first_possible(self, number: int, places: Points, best: Place | None) -> Place | None:
        """Return which of some places (P, 2) is the nearest possible, and nearer than the best."""
        wanted = self.goal.places[number]
        places = np.round(places, DECIMALS) + 0.0  # no -0
        away = np.hypot(*(places - wanted).T)
        order = np.argsort(away, kind="stable")
        if best is not None:
            order = order[away[order] < np.hypot(*(best - wanted)) - FINE / 10]
        for some in np.array_split(order, len(order) // AT_ONCE + 1):
            for place in places[some][self._in_reach(number, places[some])]:
                if self._with_place(number, place)._allows(number):
                    return np.asarray(place)
        return None

    def _with_place(self, number: int, place: Place) -> Self:
        """Return the problem with another place (2,) [m] of a pose."""
        poses = list(self.goal.poses)
        poses[number] = replace(poses[number], x=float(place[0]), y=float(place[1]))
        return replace(self, goal=replace(self.goal, poses=tuple(poses)))

    def _allows(self, number: int, most: float = 0.0) -> bool:
        """Tell whether a pose and those before it are possible, with an overlap up to `most` [m].

        Without any, noise of the next scene makes no difference.
        """
        goal = replace(self.goal, poses=self.goal.poses[: number + 1])
        try:
            replace(self, goal=goal)._check_places(most)
        except SainError:
            return False
        return True

    def span(self, body: int) -> tuple[float, float]:
        """Return the radii [m] of a body's inscribed and circumscribed circles."""
        shape, radius = self.bodies.shapes[body], float(self.scene[body, RADIUS])
        inscribed = 1.0 if shape.is_round else outline_of(shape).inscribed
        return inscribed * radius, shape.circumradius * radius
