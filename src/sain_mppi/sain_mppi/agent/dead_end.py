"""Why pushes bring a body no nearer to its pose: geometry of the scene, and errors of the model."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import make_push, strokes
from sain_core.scene import POSITION, wrap_angle
from sain_core.types import Scalars
from sain_mppi.objective.cost import table_room
from sain_mppi.objective.problem import Problem

OBLIQUE: Final = np.pi / 4  # [rad], a push this far off the way still moves a body along it
LOCATIONS: Final = 36  # around an outline, from which pushes are tried
ANGLES: Final = (-0.6, -0.3, 0.0, 0.3, 0.6)  # [rad]
LENGTHS: Final = (0.02, 0.06, 0.12)  # [m]
BEHIND: Final = 0.01  # [m], a pushing body that is nearer to its place stands there

Place = Float[ndarray, "2"]


class Cause(StrEnum):
    """What kind of reason it is."""

    REACH = "out_of_reach"
    ROOM = "no_room"
    BLOCKED = "blocked"
    SIDE = "no_side"
    NOISE = "noise"
    MODEL = "model_error"
    UNEXPLAINED = "unexplained"


@dataclass(frozen=True)
class DeadEnd:
    """So many pushes brought a body no nearer to its pose, and why."""

    cause: Cause
    body: int
    pushes: int
    reason: str

    def __str__(self) -> str:
        return f"{self.pushes} pushes brought body {self.body} no nearer: {self.reason}"


@dataclass(frozen=True, eq=False)
class Way:
    """The straight way of the body that is farthest from its pose, and who has to push it."""

    problem: Problem  # scene and goal
    body: int  # the body
    pusher: int  # the body that the tool pushes: itself, or another one
    place: Place  # where the body is
    left: float  # how far its place is [m]
    direction: Place  # which way that is
    behind: Place  # where the pushing body has to be, or the tool where the body is pushed itself
    stand: Place  # where the tool has to stand

    @classmethod
    def of(cls, problem: Problem) -> "Way":
        """Return the way of the body that is farthest from its pose."""
        number = int(np.argmax(problem.goal.errors(problem.scene, problem.bodies)[0]))
        pose, pusher = problem.goal.poses[number], problem.pushers[number]
        place = np.asarray(problem.scene[pose.body, POSITION])
        way = np.array([pose.x, pose.y]) - place
        left, tool = float(np.linalg.norm(way)), problem.feasibility.limits.tool_radius
        direction = np.asarray(way / max(left, 1e-9))
        size, own = problem.span(pose.body)[0], problem.span(pusher)[0]
        direct = pusher == pose.body
        behind = place - (size + (tool if direct else own)) * direction
        stand = behind if direct else behind - (own + tool) * direction
        return cls(problem, pose.body, pusher, place, left, direction, behind, stand)

    def distance(self, place: Place) -> float:
        """Return how far a place is from this way [m]."""
        along = float(np.clip((place - self.place) @ self.direction, 0.0, self.left))
        return float(np.linalg.norm(place - self.place - along * self.direction))

    @property
    def has_room(self) -> bool:
        """Whether there is room on the table for the pushing body, and in reach for the tool."""
        feasibility, wide = self.problem.feasibility, self.problem.span(self.pusher)[1]
        direct = self.pusher == self.body
        on_table = direct or table_room(self.behind, feasibility.table) >= wide
        return bool(on_table and feasibility.reach.contains(self.stand))

    @property
    def wanted(self) -> float:
        """The heading [rad] in which the pushed body has to move next."""
        to = self.direction
        if self.pusher != self.body:
            ahead = self.behind - self.problem.scene[self.pusher, POSITION]
            to = ahead if np.linalg.norm(ahead) > BEHIND else to
        return float(np.arctan2(to[1], to[0]))


def find_dead_end(problem: Problem, pushes: int, error: Scalars | None = None) -> DeadEnd:
    """Return why so many pushes brought the farthest body no nearer.

    Args:
        problem: scene and goal.
        pushes: without progress.
        error: (N,) [m], mean error of predicted places on the way; None: none was predicted.
    """
    way = Way.of(problem)
    found = next(_causes(way, error), (Cause.UNEXPLAINED, UNEXPLAINED))
    return DeadEnd(found[0], way.body, pushes, found[1])


UNEXPLAINED: Final = (
    "reach, sides, other bodies, noise and the model's errors do not explain it; move a body, or"
    " choose another goal"
)


def _causes(way: Way, error: Scalars | None) -> Iterator[tuple[Cause, str]]:
    left, problem = 1e3 * way.left, way.problem
    shortest = problem.shortest
    if 0.0 < way.left <= shortest:
        text = f"{left:.0f} mm are left, and noise hides ways below {1e3 * shortest:.0f} mm"
        yield Cause.NOISE, f"{text}; allow a larger tolerance, or reduce the noise"
    if error is not None and (off := float(error[way.body])) > way.left:
        text = f"{left:.0f} mm are left, and predictions err by {1e3 * off:.0f} mm"
        yield Cause.MODEL, f"{text}; allow a larger tolerance, or teach the model these bodies"
    if not problem.feasibility.reach.contains(way.stand):
        x, y = way.stand
        text = f"the tool would have to stand at ({x:.2f}, {y:.2f}) m, out of the arm's reach"
        yield Cause.REACH, f"{text}; choose a goal farther inside"
    elif not way.has_room:
        text = f"the table has no room for body {way.pusher} behind body {way.body}"
        yield Cause.ROOM, f"{text}; choose a goal farther inside"
    if (other := _obstacle(way)) is not None:
        text = f"body {other} is in the way; move it, or choose another goal"
        yield Cause.BLOCKED, text
    if not _has_side(way):
        text = f"no permitted push moves body {way.pusher} where it has to go"
        yield Cause.SIDE, f"{text}; move a body, or choose another goal"


def _obstacle(way: Way) -> int | None:
    """Return a body that stands where the others have to go; None: there is none."""
    problem, scene = way.problem, way.problem.scene
    tool, wide = problem.feasibility.limits.tool_radius, problem.span(way.body)[0]
    for other in range(len(scene)):
        if other in (way.body, way.pusher):
            continue
        place, size = scene[other, POSITION], problem.span(other)[0]
        stands = np.linalg.norm(place - way.stand) < size + tool
        if stands or way.distance(place) < size + wide:
            return other
    return None


def _has_side(way: Way) -> bool:
    """Tell whether the arm can make a push in about the wanted direction."""
    problem = way.problem
    locations = np.linspace(-np.pi, np.pi, LOCATIONS, endpoint=False)
    grid = np.meshgrid(locations, ANGLES, LENGTHS, indexing="ij")
    pushes = make_push(*(part.ravel() for part in grid), body=way.pusher)
    scenes = np.broadcast_to(problem.scene, (len(pushes), *problem.scene.shape))
    headings = strokes(scenes, pushes, problem.feasibility.limits, problem.bodies)[1]
    along = np.abs(wrap_angle(headings - way.wanted)) < OBLIQUE
    return bool((along & problem.possible(pushes)).any())
