"""Why pushes bring a body no nearer to its pose: geometry of the scene, and errors of the model."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import make_push, strokes
from sain_core.scene import POSITION, wrap_angle
from sain_core.types import Scalars
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
    """The straight way of the body that is farthest from its pose, and who has to push it.

    Attributes:
        problem: scene and goal.
        number: of the pose.
    """

    problem: Problem
    number: int

    @classmethod
    def of(cls, problem: Problem) -> "Way":
        """Return the way of the body that is farthest from its pose."""
        away = problem.goal.errors(problem.scene, problem.bodies)[0]
        return cls(problem, int(np.argmax(away)))

    @property
    def body(self) -> int:
        """The body."""
        return self.problem.goal.poses[self.number].body

    @property
    def pusher(self) -> int:
        """The body that the tool pushes: itself, or another one."""
        return self.problem.pushers[self.number]

    @property
    def place(self) -> Place:
        """Where the body is."""
        return np.asarray(self.problem.scene[self.body, POSITION])

    @property
    def end(self) -> Place:
        """Where it should be."""
        pose = self.problem.goal.poses[self.number]
        return np.array([pose.x, pose.y])

    @property
    def left(self) -> float:
        """How far that is [m]."""
        return float(np.linalg.norm(self.end - self.place))

    @cached_property
    def direction(self) -> Place:
        """Which way that is."""
        return np.asarray((self.end - self.place) / max(self.left, 1e-9))

    def distance(self, place: Place) -> float:
        """Return how far a place is from this way [m]."""
        along = float(np.clip((place - self.place) @ self.direction, 0.0, self.left))
        return float(np.linalg.norm(place - self.place - along * self.direction))

    def size(self, body: int) -> float:
        """Return the radius of a body's inscribed circle [m]: as near as anything can come."""
        return self.problem.span(body)[0]

    @property
    def behind(self) -> Place:
        """Where the pushing body has to be, or the tool where the body is pushed itself."""
        other = self.tool if self.pusher == self.body else self.size(self.pusher)
        return np.asarray(self.place - (self.size(self.body) + other) * self.direction)

    @property
    def stand(self) -> Place:
        """Where the tool has to stand."""
        if self.pusher == self.body:
            return self.behind
        return np.asarray(self.behind - (self.size(self.pusher) + self.tool) * self.direction)

    @property
    def tool(self) -> float:
        """The radius of the tool [m]."""
        return self.problem.feasibility.limits.tool_radius

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
    if (other := _obstacle(way)) is not None:
        text = f"body {other} is in the way; move it, or choose another goal"
        yield Cause.BLOCKED, text
    if not _has_side(way):
        text = f"no permitted push moves body {way.pusher} where it has to go"
        yield Cause.SIDE, f"{text}; move a body, or choose another goal"


def _obstacle(way: Way) -> int | None:
    """Return a body that stands where the others have to go; None: there is none."""
    scene = way.problem.scene
    for other in range(len(scene)):
        if other in (way.body, way.pusher):
            continue
        place, size = scene[other, POSITION], way.size(other)
        if way.distance(place) < size + way.size(way.body) or (
            np.linalg.norm(place - way.stand) < size + way.tool
        ):
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
