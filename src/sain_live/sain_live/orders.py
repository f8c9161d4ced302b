"""What a viewer can ask for, and goals as the page handles them.

The node carries orders out; tests of the page take note of them. A goal is checked before that.
"""

import dataclasses
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Final, Protocol

import numpy as np

from sain_core.config import FieldSetting, settings_of
from sain_core.errors import ConfigError, InvalidInputError
from sain_core.feasibility import Feasibility
from sain_core.goal import MOST_SHARED, BodyPose, Goal
from sain_core.scene import POSITION, TARGET, THETA
from sain_core.shapes.bodies import Bodies, Role, overlap
from sain_core.types import Scene
from sain_eval.scenes.families import AnywhereScenario, PoseScenario, ScenarioScene
from sain_eval.scenes.scenarios import draw_scene, find_scenario
from sain_mppi.config import PlannerConfig
from sain_mppi.objective.problem import Problem

AS_DRAWN: Final = "as the scenario has it"
PREFIX: Final = "planner."  # of its parameters
Field = dataclasses.Field[Any]


@dataclass(frozen=True)
class Reset:
    """A new episode: scenario, seed, shape of its bodies and world."""

    scenario: str
    seed: int
    shape: str = AS_DRAWN
    world: str = ""

    def case(self) -> ScenarioScene:
        """Draw the scene.

        Raises:
            ConfigError: no such scenario, or the shape of its bodies is not free.
        """
        if self.shape == AS_DRAWN:
            return draw_scene(self.scenario, self.seed)
        scenario: Any = find_scenario(self.scenario)
        if isinstance(scenario, PoseScenario):
            return replace(scenario, shape=self.shape).scene(self.seed)
        if isinstance(scenario, AnywhereScenario):
            return replace(scenario, target_shape=self.shape).scene(self.seed)
        raise ConfigError(
            f"the bodies of scenario {self.scenario} have shapes of their own; choose"
            f" {AS_DRAWN!r}, or another scenario such as push_t"
        )


class Orders(Protocol):
    """Each returns at once; what became of it is seen in `LiveState`."""

    def start(self) -> None:
        """Follow the goal, push by push."""

    def pause(self) -> None:
        """Follow no goal any more; a push that is under way ends first."""

    def push_once(self) -> None:
        """Follow the goal for one push."""

    def reset(self, reset: Reset) -> None:
        """Start a new episode."""

    def aim(self, aim: Goal) -> None:
        """Take a goal that was dragged."""

    def set(self, name: str, value: Any) -> None:
        """Change a parameter of the planner."""

    def load(self, model: str) -> None:
        """Serve another model."""

    def learn(self, learns: bool) -> None:
        """Learn from pushes, or not."""


def planner_settings() -> list[FieldSetting]:
    """Return the planner's settings by the names of its parameters, those of its groups last."""
    return sorted(settings_of(PlannerConfig(), PREFIX), key=lambda one: one.name.count("."))


FIRST_WAY: Final = (0.12, 0.0)  # [m], from a body to the goal that it is given first
FEASIBILITY: Final = Feasibility()


def first_aim(scene: Scene, bodies: Bodies) -> Goal | None:
    """Return a goal to begin with, for a scene that has none: near the target, on the table."""
    movable = [body for body in range(len(bodies)) if bodies.roles[body] is not Role.FIXED]
    body = TARGET if TARGET in movable else movable[0]
    shape = bodies.shapes[body]
    heading = None if shape.is_round else float(scene[body, THETA])
    for far, way in product((1.0, -1.0, 0.5, -0.5, 0.0), (FIRST_WAY, FIRST_WAY[::-1])):
        place = scene[body, POSITION] + far * np.array(way)
        if FEASIBILITY.table.contains(place):
            x, y = place.tolist()
            goal = Goal((BodyPose(body, x, y, heading),))
            with suppress(ValueError):  # another place may be free
                check_aim(goal, scene, bodies)
                return goal
    return None


def check_aim(goal: Goal, scene: Scene, bodies: Bodies) -> None:
    """Check that bodies can be brought to a goal, before it is sent.

    Bodies that the tool may push are no obstacle: the planner moves them away.

    Raises:
        OffTableError: off the table.
        UnreachableError: the arm cannot push a target there, from any side.
        InvalidInputError: into a body that stays where it is; all else that `Goal` checks.
    """
    goal.check(scene, bodies, FEASIBILITY.table)
    Problem(scene, goal, bodies, scene, FEASIBILITY).check_reach()
    placed = goal.placed(scene)
    for body in goal.wanted:
        for other, role in enumerate(bodies.roles):
            if other in goal.wanted or role is Role.PUSHABLE:
                continue
            deep = overlap(placed, bodies, body, other)
            if deep > MOST_SHARED:
                raise InvalidInputError(
                    f"the goal of body {body} lies in body {other}"
                    f" ({bodies.shapes[other].name}), by {1e3 * deep:.0f} mm;"
                    " drag it to a free place"
                )
