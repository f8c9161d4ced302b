"""Scenarios of disks, and of a cube among them: each draws a scene from a seed.

A scene is valid by construction: disks apart and on the table, the goal on the table and in
reach, and a straight push through the target to the goal possible for the arm once the mid disk
stands behind the target.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from sain_core.feasibility import Feasibility
from sain_core.goal import Goal
from sain_core.scene import POSITION, TARGET, THETA, check_scene, unit
from sain_core.seeding import generator
from sain_core.shapes.library import get_shape
from sain_core.shapes.solids import DISK
from sain_core.types import Scene
from sain_eval.scenes.placement import draw_extra_disks, draw_goal, touching_distance
from sain_eval.scenes.scenario_scene import ScenarioScene
from sain_sim.world.parameters import (
    FRICTION_RANGE,
    PAPER,
    RANGES,
    WorldParameters,
    sample_parameters,
)

CONTACT_GAP: Final = 0.001  # [m], "touching": as near as disks can be set without overlap


@dataclass(frozen=True)
class PaperScenario:
    """The paper's own: the target straight ahead of the mid disk, the goal straight ahead of it."""

    name: str = "paper"
    mid: tuple[float, float] = (0.35, 0.0)  # [m]
    goal: tuple[float, float] = (0.80, 0.0)  # [m]
    shift: float = 0.0  # [m], of the goal in x and in y, with random signs
    target_shape: str = DISK

    def scene(self, seed: int) -> ScenarioScene:
        """Draw masses, radii, friction and the goal's shift."""
        random = generator(seed, "scenario", self.name)
        drawn = sample_parameters(random, 2)
        mid = np.array(self.mid)
        target = mid + np.array([sum(drawn.radii) + CONTACT_GAP, 0.0])
        goal = np.array(self.goal) + self.shift * random.choice([-1.0, 1.0], 2)
        disks = drawn.scene(np.stack([mid, target]))
        shapes = (DISK, self.target_shape)
        return ScenarioScene(self.name, seed, disks, drawn.friction, shapes, Goal.place(*goal))


@dataclass(frozen=True)
class AnywhereScenario:
    """What a user would ask: the target at any side of the mid disk, the goal in any direction."""

    name: str = "anywhere"
    mid: tuple[float, float] = (0.45, 0.0)  # [m]
    scatter: float = 0.03  # [m], of the mid disk in x and y
    goal_distance: tuple[float, float] = (0.15, 0.30)  # [m], from the target
    extra_disks: tuple[int, int] = (0, 0)  # fewest and most further disks
    target_shape: str = DISK  # one with corners turns a side to the mid disk
    friction: tuple[float, float] = FRICTION_RANGE  # with the table

    def scene(self, seed: int) -> ScenarioScene:
        """Draw parameters, places and goal; redraw the places until the scene can be solved."""
        return self.draw(generator(seed, "scenario", self.name), seed)

    def draw(self, random: np.random.Generator, seed: int) -> ScenarioScene:
        """Draw one scene; see `scene`."""
        low, high = self.extra_disks
        count = 2 + int(random.integers(low, high + 1))
        ranges = RANGES[PAPER]._replace(friction=self.friction)
        drawn = sample_parameters(random, count, ranges=ranges)
        shapes = (DISK, self.target_shape, *(DISK,) * (count - 2))
        feasibility = Feasibility()
        while True:
            pair = self._draw_pair(random, drawn)
            goal = draw_goal(pair, self.goal_distance, feasibility, random)
            if goal is None:
                continue
            extra = draw_extra_disks(pair, goal, drawn.radii[2:], feasibility, random)
            if extra is None:
                continue
            positions = np.concatenate([pair[:, POSITION], extra])
            headings = np.append(pair[:, THETA], np.zeros(count - 2))
            disks = check_scene(drawn.scene(positions, headings), feasibility.table)
            return ScenarioScene(self.name, seed, disks, drawn.friction, shapes, Goal.place(*goal))

    def _draw_pair(self, random: np.random.Generator, drawn: WorldParameters) -> Scene:
        """Return mid disk and target (2, 8), touching at a uniform bearing."""
        mid = np.array(self.mid) + random.uniform(-self.scatter, self.scatter, 2)
        bearing = np.asarray(random.uniform(-np.pi, np.pi))
        pair = WorldParameters(drawn.masses[:2], drawn.radii[:2], drawn.shapes[:2], drawn.friction)
        scene = pair.scene(np.stack([mid, mid]))
        scene[TARGET, POSITION] = mid + (touching_distance(scene) + CONTACT_GAP) * unit(bearing)
        scene[TARGET, THETA] = 0.0 if get_shape(self.target_shape).is_round else bearing
        return scene
