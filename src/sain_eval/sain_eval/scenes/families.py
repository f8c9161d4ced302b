"""The families of scenarios: each draws a scene from a seed.

A scene is valid by construction. Bodies are apart, on the table, and their goals in reach. Where
body 0 has to push the target, a straight push through both to the goal is possible once body 0
stands behind the target. Where bodies go to poses, each has room for the tool all around, at its
start and at its goal, and no goal is reached at the start.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import pi
from typing import Any, Final, Self

import numpy as np

from sain_core.goal import BodyPose, Goal
from sain_core.randomness import generator
from sain_core.scene import POSITION, RADIUS, TARGET, THETA, make_scene, unit
from sain_core.shapes.bodies import Bodies, Role, check_bodies
from sain_core.shapes.library import check_shapes, get_shape, library
from sain_core.shapes.shape import Pair
from sain_core.shapes.solids import DISK
from sain_core.types import Angles, Points, Scene
from sain_eval.scenes.placement import (
    FEASIBILITY,
    draw_blockers,
    draw_extra_disks,
    draw_goal,
    draw_places,
    has_tool_room,
    touching_distance,
)
from sain_sim.world.parameters import (
    FRICTION_RANGE,
    MASS_RANGE,
    PAPER,
    RANGES,
    WorldParameters,
    sample_parameters,
)
from sain_sim.world.truth import RANDOMISED_TRUTH, TruthConfig

MAX_PUSHES: Final = 15  # paper section II-D


@dataclass(frozen=True)
class ScenarioScene:
    """One scene to solve, with the hidden truth about its world."""

    scenario: str  # its name
    seed: int  # what it was drawn from
    disks: Scene  # (N, 8), the bodies at rest
    friction: float  # between bodies and table; hidden from all controllers but the oracle
    shapes: tuple[str, ...]  # a footprint for each body, as `sain_core.shapes` names them
    goal: Goal  # what bodies should come to
    max_pushes: int = MAX_PUSHES  # for each goal
    truth: TruthConfig = RANDOMISED_TRUTH  # the world that it plays in
    roles: tuple[str, ...] = ()  # of each body; none: the paper's
    heights: tuple[float, ...] = ()  # of bodies [m]; none: ours
    mass_centres: tuple[Pair, ...] = ()  # of bodies, from their centroids [m]; none: there
    # goals that follow without a reset, each once the one before is reached
    further: tuple[Goal, ...] = ()
    # what counts as one, where the goals judge by something else than a tolerance
    success: str = ""

    @property
    def bodies(self) -> Bodies:
        """Shape and role of each body."""
        return Bodies.named(self.shapes, self.roles)

    @property
    def goals(self) -> tuple[Goal, ...]:
        """All goals, in order."""
        return (self.goal, *self.further)

    def within(self, truth: TruthConfig) -> "ScenarioScene":
        """Return the same scene in another world, with the friction that it has there."""
        moved = replace(self, truth=truth)
        return replace(moved, friction=moved.parameters().friction)

    def parameters(self) -> WorldParameters:
        """Return the simulated world that this scene plays in."""
        shapes = check_shapes(self.shapes)
        parameters = WorldParameters.of_scene(self.disks, self.friction, shapes, self.roles)
        return self.truth.roughen(parameters.with_stated(self.heights, self.mass_centres))


CONTACT_GAP: Final = 0.001  # [m], "touching": as near as disks can be set without overlap
LIBRARY_SHAPES: Final = 33  # of the library, that are used
PAPER_MID: Final = (0.35, 0.0)  # [m]
PAPER_GOAL: Final = (0.80, 0.0)  # [m]
MIDDLE: Final = (0.45, 0.0)  # [m], of body 0 elsewhere
SCATTER: Final = 0.03  # [m], of it in x and y
GOAL_DISTANCE: Final = (0.15, 0.30)  # [m], from body 1
ONE_SIZE: Final = (0.09, 0.11)  # [m], circumscribed radius of a body that is alone
MANY_SIZE: Final = (0.06, 0.08)  # [m], of one of several
LEAST_WAY: Final = 0.08  # [m], from start to goal
POSE_PUSHES: Final = 30  # for one body to its pose
PUSHES_PER_BODY: Final = 20  # for several bodies
STREAK_GOALS: Final = 100
INDIRECT_GAP: Final = (0.005, 0.05)  # [m], between the circumscribed circles of two bodies
BLOCKED_DISTANCE: Final = (0.20, 0.30)  # [m], from the target to its goal


@cache
def library_shapes() -> tuple[str, ...]:
    """Return the names of the first 33 footprints: disk, cube, and those of the library."""
    return (DISK, "cube", *(shape.name for shape in library()))[:LIBRARY_SHAPES]


@dataclass(frozen=True)
class Drawn:
    """Bodies without places, and the friction of their table."""

    masses: np.ndarray  # (N,) [kg]
    radii: np.ndarray  # (N,) [m], of the states
    sizes: np.ndarray  # (N,) [m], circumscribed radii
    shapes: tuple[str, ...]
    friction: float

    @classmethod
    def paper(
        cls,
        random: np.random.Generator,
        shapes: Sequence[str],
        friction: tuple[float, float] = FRICTION_RANGE,
    ) -> Self:
        """Draw the paper's masses, radii and friction: a mid disk, and others like the target."""
        ranges = RANGES[PAPER]._replace(friction=friction)
        drawn = sample_parameters(random, len(shapes), ranges=ranges)
        radii = np.array(drawn.radii)
        return cls(np.array(drawn.masses), radii, radii, tuple(shapes), drawn.friction)

    @classmethod
    def sized(
        cls, random: np.random.Generator, shapes: Sequence[str], size: tuple[float, float]
    ) -> Self:
        """Draw circumscribed radii, and masses and friction as in the paper."""
        sizes = random.uniform(*size, len(shapes))
        radii = sizes / np.array([get_shape(name).circumradius for name in shapes])
        masses = random.uniform(*MASS_RANGE, len(shapes))
        friction = float(random.uniform(*FRICTION_RANGE))
        return cls(masses, radii, sizes, tuple(shapes), friction)

    def at(self, places: Points, headings: Angles | None = None) -> Scene:
        """Return the first of the bodies (M, 8) at places (M, 2), at rest."""
        count = len(places)
        return make_scene(places, self.masses[:count], self.radii[:count], headings)

    def turned(self, places: Points, random: np.random.Generator) -> Scene:
        """Return the bodies (N, 8) at places (N, 2), with any headings."""
        return self.at(places, random.uniform(-pi, pi, len(places)))

    def goal(self, places: Points, headings: Angles) -> Goal:
        """Return poses of all bodies at places (N, 2) with headings (N,); a disk has none."""
        poses = zip(places.tolist(), headings.tolist(), self.shapes, strict=True)
        return Goal(
            tuple(
                BodyPose(body, x, y, None if get_shape(shape).is_round else heading)
                for body, ((x, y), heading, shape) in enumerate(poses)
            )
        )

    def case(self, name: str, seed: int, disks: Scene, goal: Goal, **more: Any) -> ScenarioScene:
        """Return the scene (N, 8) of a scenario with a goal; `more` fields as in its class."""
        return ScenarioScene(name, seed, disks, self.friction, self.shapes, goal, **more)


@dataclass(frozen=True)
class PaperScenario:
    """The paper's own: the target straight ahead of the mid disk, the goal straight ahead of it."""

    name: str = "paper"
    shift: float = 0.0  # [m], of the goal in x and in y, with random signs
    target_shape: str = DISK

    def scene(self, seed: int) -> ScenarioScene:
        """Draw masses, radii, friction and the goal's shift."""
        random = generator(seed, "scenario", self.name)
        drawn = Drawn.paper(random, (DISK, self.target_shape))
        mid = np.array(PAPER_MID)
        target = mid + np.array([drawn.radii.sum() + CONTACT_GAP, 0.0])
        goal = np.array(PAPER_GOAL) + self.shift * random.choice([-1.0, 1.0], 2)
        disks = drawn.at(np.stack([mid, target]))
        return drawn.case(self.name, seed, disks, Goal.place(*goal))


@dataclass(frozen=True)
class AnywhereScenario:
    """What a user would ask: the target at any side of the mid disk, the goal in any direction."""

    name: str = "anywhere"
    goal_distance: tuple[float, float] = GOAL_DISTANCE  # [m], from the target
    extra_disks: tuple[int, int] = (0, 0)  # fewest and most further disks
    target_shape: str = DISK  # one with corners turns a side to the mid disk
    friction: tuple[float, float] = FRICTION_RANGE  # with the table

    def scene(self, seed: int) -> ScenarioScene:
        """Draw parameters, places and goal; redraw the places until the scene can be solved."""
        return self.draw(generator(seed, "scenario", self.name), seed)

    def draw(self, random: np.random.Generator, seed: int) -> ScenarioScene:
        """Draw one scene; see `scene`."""
        low, high = self.extra_disks
        extra = int(random.integers(low, high + 1))
        shapes = (DISK, self.target_shape, *(DISK,) * extra)
        drawn = Drawn.paper(random, shapes, self.friction)
        while True:
            pair = self._draw_pair(random, drawn)
            goal = draw_goal(pair, self.goal_distance, random)
            if goal is None:
                continue
            places = draw_extra_disks(pair, goal, drawn.radii[2:], random)
            if places is None:
                continue
            positions = np.concatenate([pair[:, POSITION], places])
            disks = drawn.at(positions, np.append(pair[:, THETA], np.zeros(extra)))
            check_bodies(disks, table=FEASIBILITY.table)
            return drawn.case(self.name, seed, disks, Goal.place(*goal))

    def _draw_pair(self, random: np.random.Generator, drawn: Drawn) -> Scene:
        """Return mid disk and target (2, 8), touching at a uniform bearing."""
        mid = np.array(MIDDLE) + random.uniform(-SCATTER, SCATTER, 2)
        bearing = np.asarray(random.uniform(-np.pi, np.pi))
        pair = drawn.at(np.stack([mid, mid]))
        pair[TARGET, POSITION] = mid + (touching_distance(pair) + CONTACT_GAP) * unit(bearing)
        pair[TARGET, THETA] = 0.0 if get_shape(self.target_shape).is_round else bearing
        return pair


@dataclass(frozen=True)
class IndirectScenario:
    """The paper's task with any two shapes: body 0 pushes body 1 to a place."""

    name: str = "shapes_indirect"

    def scene(self, seed: int) -> ScenarioScene:
        """Draw two shapes, places and a goal; redraw the places until the scene can be solved."""
        random = generator(seed, "scenario", self.name)
        shapes = random.choice(library_shapes(), 2, replace=False).tolist()
        drawn = Drawn.sized(random, shapes, MANY_SIZE)
        while True:
            first = np.array(MIDDLE) + random.uniform(-SCATTER, SCATTER, 2)
            apart = drawn.sizes.sum() + random.uniform(*INDIRECT_GAP)
            bearing = random.uniform(-pi, pi)
            second = first + apart * np.array([np.cos(bearing), np.sin(bearing)])
            disks = drawn.turned(np.stack([first, second]), random)
            if not has_tool_room(disks[:, POSITION], drawn.sizes).all():
                continue
            circles = disks.copy()
            circles[:, RADIUS] = drawn.sizes
            place = draw_goal(circles, GOAL_DISTANCE, random)
            if place is not None and has_tool_room(place, drawn.sizes[TARGET]):
                return drawn.case(self.name, seed, disks, Goal.place(*place))


@dataclass(frozen=True)
class BlockedScenario:
    """As anywhere, with one or two bodies of any shape in the target's way; they are pushable."""

    name: str = "blocked"

    def scene(self, seed: int) -> ScenarioScene:
        """Draw mid disk, target and goal, then what is in the way, until there is room for it."""
        random = generator(seed, "scenario", self.name)
        count = int(random.integers(1, 3))
        shapes = random.choice(library_shapes(), count).tolist()
        blockers = Drawn.sized(random, shapes, MANY_SIZE)
        base = AnywhereScenario(self.name, goal_distance=BLOCKED_DISTANCE)
        while True:
            case = base.draw(random, seed)
            places = draw_blockers(case.disks, case.goal.places[0], blockers.sizes, random)
            if places is not None:
                break
        return ScenarioScene(
            self.name,
            seed,
            np.concatenate([case.disks, blockers.turned(places, random)]),
            case.friction,
            (*case.shapes, *blockers.shapes),
            case.goal,
            max_pushes=POSE_PUSHES,
            roles=(Role.PUSHABLE, Role.MOVABLE, *(Role.PUSHABLE,) * count),
        )


@dataclass(frozen=True)
class PoseScenario:
    """Bodies to poses; all are pushable."""

    name: str  # of the scenario
    # of every body; None: one body has the shape with the seed's number in the library, several
    # have any shapes
    shape: str | None = None
    count: int = 1  # number of bodies
    goals: int = 1  # poses of each body in a row, without a reset

    def scene(self, seed: int) -> ScenarioScene:
        """Draw bodies, starts and poses."""
        random = generator(seed, "scenario", self.name)
        alone = self.count == 1
        drawn = Drawn.sized(random, self._shapes(seed, random), ONE_SIZE if alone else MANY_SIZE)
        disks = drawn.turned(draw_places(drawn.sizes, random), random)
        first, *further = self._goals(drawn, disks[:, POSITION], random)
        return drawn.case(
            self.name,
            seed,
            disks,
            first,
            max_pushes=POSE_PUSHES if alone else PUSHES_PER_BODY * self.count,
            roles=(Role.PUSHABLE,) * self.count,
            further=tuple(further),
        )

    def _shapes(self, seed: int, random: np.random.Generator) -> Sequence[str]:
        if self.shape is not None:
            return (self.shape,) * self.count
        names = library_shapes()
        if self.count == 1:
            return (names[seed % len(names)],)
        shapes: list[str] = random.choice(names, self.count).tolist()
        return shapes

    def _goals(self, drawn: Drawn, places: Points, random: np.random.Generator) -> list[Goal]:
        """Draw poses, each away from where its body is (N, 2) when they are given."""
        goals = []
        for _ in range(self.goals):
            places = draw_places(drawn.sizes, random, places, LEAST_WAY)
            goals.append(drawn.goal(places, random.uniform(-pi, pi, len(places))))
        return goals
