"""Scenarios of bodies of any shape: each draws a scene from a seed.

A scene is valid by construction. Each body lies on the table at its start and at its goal, its
circumscribed circle apart from those of the others. Each body that the tool may touch has room for
the tool all around. No goal is reached at the start.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import pi
from typing import Final

import numpy as np

from sain_core.feasibility import Feasibility
from sain_core.goal import BodyPose, Goal
from sain_core.scene import POSITION, RADIUS, TARGET, make_scene
from sain_core.seeding import generator
from sain_core.shapes.bodies import Role
from sain_core.shapes.library import get_shape, library
from sain_core.shapes.solids import DISK
from sain_core.types import Points, Scene
from sain_eval.scenes.disk_scenarios import AnywhereScenario
from sain_eval.scenes.placement import draw_goal
from sain_eval.scenes.scenario_scene import MAX_PUSHES, ScenarioScene
from sain_eval.scenes.tool_room import draw_blockers, draw_places, has_tool_room
from sain_sim.world.parameters import FRICTION_RANGE, MASS_RANGE

LIBRARY_SHAPES: Final = 33  # of the library, that are used
ONE_SIZE: Final = (0.09, 0.11)  # [m], circumscribed radius of a body that is alone
MANY_SIZE: Final = (0.06, 0.08)  # [m], of one of several
LEAST_WAY: Final = 0.08  # [m], from start to goal
POSE_PUSHES: Final = 30  # for one body to its pose
PUSHES_PER_BODY: Final = 20  # for several bodies
STREAK_GOALS: Final = 100
INDIRECT_GAP: Final = (0.005, 0.05)  # [m], between the circumscribed circles of two bodies
BLOCKED_DISTANCE: Final = (0.20, 0.30)  # [m], from the target to its goal


@cache
def library_footprints() -> tuple[str, ...]:
    """Return the names of the first 33 footprints: disk, cube, and those of the library."""
    return (DISK, "cube", *(shape.footprint for shape in library()))[:LIBRARY_SHAPES]


@dataclass(frozen=True)
class PoseScenario:
    """Bodies to poses; all are pushable.

    Attributes:
        name: of the scenario.
        shape: of every body; None: one body has the shape with the seed's number in the library,
            several have any shapes.
        count: number of bodies.
    """

    name: str
    shape: str | None = None
    count: int = 1

    def scene(self, seed: int) -> ScenarioScene:
        """Draw bodies, starts and poses."""
        random = generator(seed, "scenario", self.name)
        shapes = self._shapes(seed, random)
        alone = self.count == 1
        drawn = _Drawn.of(random, shapes, ONE_SIZE if alone else MANY_SIZE)
        disks = drawn.at(draw_places(drawn.sizes, random), random)
        return ScenarioScene(
            self.name,
            seed,
            disks,
            drawn.friction,
            shapes,
            draw_poses(drawn.sizes, shapes, disks[:, POSITION], random),
            max_pushes=POSE_PUSHES if alone else PUSHES_PER_BODY * self.count,
            roles=(Role.PUSHABLE,) * self.count,
        )

    def _shapes(self, seed: int, random: np.random.Generator) -> tuple[str, ...]:
        if self.shape is not None:
            return (self.shape,) * self.count
        known = library_footprints()
        if self.count == 1:
            return (known[seed % len(known)],)
        return tuple(random.choice(known, self.count).tolist())


@dataclass(frozen=True)
class StreakScenario:
    """One body to many poses in a row, without a reset."""

    name: str = "streak"
    shape: str = "t"
    goals: int = STREAK_GOALS

    def scene(self, seed: int) -> ScenarioScene:
        """Draw the body, its start and its poses."""
        random = generator(seed, "scenario", self.name)
        shapes = (self.shape,)
        drawn = _Drawn.of(random, shapes, ONE_SIZE)
        disks = drawn.at(draw_places(drawn.sizes, random), random)
        places, goals = disks[:, POSITION], []
        for _ in range(self.goals):
            goals.append(draw_poses(drawn.sizes, shapes, places, random))
            places = goals[-1].places
        return ScenarioScene(
            self.name,
            seed,
            disks,
            drawn.friction,
            shapes,
            goals[0],
            max_pushes=POSE_PUSHES,
            roles=(Role.PUSHABLE,),
            further=tuple(goals[1:]),
        )


@dataclass(frozen=True)
class IndirectScenario:
    """The paper's task with any two shapes: body 0 pushes body 1 to a place."""

    name: str = "shapes_indirect"
    pusher: tuple[float, float] = (0.45, 0.0)  # [m]
    scatter: float = 0.03  # [m], of body 0 in x and y
    goal_distance: tuple[float, float] = (0.15, 0.30)  # [m], from body 1

    def scene(self, seed: int) -> ScenarioScene:
        """Draw two shapes, places and a goal; redraw the places until the scene can be solved."""
        random = generator(seed, "scenario", self.name)
        shapes = tuple(random.choice(library_footprints(), 2, replace=False).tolist())
        drawn = _Drawn.of(random, shapes, MANY_SIZE)
        feasibility = Feasibility()
        while True:
            first = np.array(self.pusher) + random.uniform(-self.scatter, self.scatter, 2)
            apart = drawn.sizes.sum() + random.uniform(*INDIRECT_GAP)
            bearing = random.uniform(-pi, pi)
            second = first + apart * np.array([np.cos(bearing), np.sin(bearing)])
            disks = drawn.at(np.stack([first, second]), random)
            if not has_tool_room(disks[:, POSITION], drawn.sizes, feasibility).all():
                continue
            circles = disks.copy()
            circles[:, RADIUS] = drawn.sizes
            place = draw_goal(circles, self.goal_distance, feasibility, random)
            if place is None or not has_tool_room(place, drawn.sizes[TARGET], feasibility):
                continue
            goal = Goal.place(*place)
            return ScenarioScene(self.name, seed, disks, drawn.friction, shapes, goal, MAX_PUSHES)


@dataclass(frozen=True)
class BlockedScenario:
    """As anywhere, with one or two bodies of any shape in the target's way; they are pushable."""

    name: str = "blocked"

    def scene(self, seed: int) -> ScenarioScene:
        """Draw mid disk, target and goal, then what is in the way, until there is room for it."""
        random = generator(seed, "scenario", self.name)
        count = int(random.integers(1, 3))
        shapes = tuple(random.choice(library_footprints(), count).tolist())
        blockers = _Drawn.of(random, shapes, MANY_SIZE)
        base = AnywhereScenario(self.name, goal_distance=BLOCKED_DISTANCE)
        while True:
            case = base.draw(random, seed)
            places = draw_blockers(case.disks, case.goal.places[0], blockers.sizes, random)
            if places is not None:
                break
        return ScenarioScene(
            self.name,
            seed,
            np.concatenate([case.disks, blockers.at(places, random)]),
            case.friction,
            (*case.shapes, *shapes),
            case.goal,
            max_pushes=POSE_PUSHES,
            roles=(Role.PUSHABLE, Role.MOVABLE, *(Role.PUSHABLE,) * count),
        )


@dataclass(frozen=True)
class _Drawn:
    """Bodies without places."""

    masses: np.ndarray  # (N,) [kg]
    radii: np.ndarray  # (N,) [m], of the states
    sizes: np.ndarray  # (N,) [m], circumscribed radii
    friction: float

    @classmethod
    def of(
        cls, random: np.random.Generator, shapes: Sequence[str], size: tuple[float, float]
    ) -> "_Drawn":
        """Draw sizes, and masses and friction as in the paper."""
        sizes = random.uniform(*size, len(shapes))
        radii = sizes / np.array([get_shape(name).circumradius for name in shapes])
        masses = random.uniform(*MASS_RANGE, len(shapes))
        return cls(masses, radii, sizes, float(random.uniform(*FRICTION_RANGE)))

    def at(self, places: Points, random: np.random.Generator) -> Scene:
        """Return the bodies (N, 8) at places (N, 2), with any headings."""
        return make_scene(places, self.masses, self.radii, random.uniform(-pi, pi, len(places)))


def draw_poses(
    sizes: np.ndarray, shapes: Sequence[str], starts: Points, random: np.random.Generator
) -> Goal:
    """Draw a pose for each body with circumscribed radii (N,), away from its start (N, 2)."""
    places = draw_places(sizes, random, starts, LEAST_WAY)
    headings = random.uniform(-pi, pi, len(sizes)).tolist()
    return Goal(
        tuple(
            BodyPose(body, x, y, None if get_shape(shapes[body]).is_round else headings[body])
            for body, (x, y) in enumerate(places.tolist())
        )
    )
