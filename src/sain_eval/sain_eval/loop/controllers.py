"""Who decides the pushes: baselines, and MPPI over any dynamics."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from sain_core.dynamics import Dynamics, as_rollout
from sain_core.errors import ConfigError, NoPushError
from sain_core.feasibility import Feasibility
from sain_core.history import PushHistory, informed_rollout
from sain_core.plugins import load_dynamics
from sain_core.push import LOCATION
from sain_core.scene import MID, POSITION, wrap_angle
from sain_core.types import PushArray, Scene
from sain_eval.scenes.scenarios import ScenarioScene
from sain_model.physics.planar import PlanarConfig, PlanarPrior
from sain_mppi.loop.progress_monitor import Replanner
from sain_mppi.planner import Planner
from sain_mppi.search.config import PlannerConfig
from sain_mppi.search.feasible_mask import permitted
from sain_mppi.search.goal import Goal

BASELINES = ("null", "straight", "random")
ORACLE = "oracle"
RANDOM_DRAWS = 256


@dataclass(frozen=True)
class Decision:
    """What a controller wants: a push and what it expects, or, without a push, to stop."""

    push: PushArray | None = None  # (3,)
    predicted: Scene | None = None  # (N, 8), after the push
    planning_time: float = 0.0  # [s]


@runtime_checkable
class Controller(Protocol):
    """Decides one push after another."""

    def decide(self, scene: Scene, goal: Goal, random: np.random.Generator) -> Decision:
        """Decide from a settled scene (N, 8); raises `SainError` when there is no way on."""
        ...

    def refused(self, push: PushArray) -> None:
        """Take note that the world refused this push (3,): nothing has moved."""
        ...

    def observed(self, scene: Scene, push: PushArray, next_scene: Scene) -> None:
        """Take note that a push (3,) led from one settled scene (N, 8) to another."""
        ...


class NullController:
    """Does nothing: what a scene is worth by itself."""

    def decide(self, scene: Scene, goal: Goal, random: np.random.Generator) -> Decision:
        """Stop."""
        return Decision()

    def refused(self, push: PushArray) -> None:
        """Never happens."""

    def observed(self, scene: Scene, push: PushArray, next_scene: Scene) -> None:
        """Learn nothing."""


class StraightController:
    """Pushes the mid disk towards the goal, as far as a push goes, without looking at contacts."""

    def __init__(self, feasibility: Feasibility) -> None:
        """Push within these limits."""
        self.limits = feasibility.limits

    def decide(self, scene: Scene, goal: Goal, random: np.random.Generator) -> Decision:
        """Push along the line from mid disk to goal by the distance left for the target."""
        way = goal - scene[MID, POSITION]
        left = float(np.linalg.norm(goal - scene[1, POSITION]))
        length = min(self.limits.clearance + left, self.limits.max_length)
        location = wrap_angle(np.arctan2(way[1], way[0]))
        return Decision(np.array([float(location), 0.0, length]))

    def refused(self, push: PushArray) -> None:
        """Stop: it has no second idea."""
        raise NoPushError(f"the straight push at {push[LOCATION]:.2f} rad was refused")

    def observed(self, scene: Scene, push: PushArray, next_scene: Scene) -> None:
        """Learn nothing."""


class RandomController:
    """Pushes from anywhere to anywhere, as long as it is permitted."""

    def __init__(self, feasibility: Feasibility) -> None:
        """Push within what this permits."""
        self.feasibility = feasibility

    def decide(self, scene: Scene, goal: Goal, random: np.random.Generator) -> Decision:
        """Draw one permitted push."""
        pushes = self.feasibility.limits.sample(random, RANDOM_DRAWS)
        pushes = pushes[permitted(scene, pushes, self.feasibility)]
        if not len(pushes):
            raise NoPushError(f"none of {RANDOM_DRAWS} random pushes can be carried out")
        return Decision(pushes[0])

    def refused(self, push: PushArray) -> None:
        """Draw again."""

    def observed(self, scene: Scene, push: PushArray, next_scene: Scene) -> None:
        """Learn nothing."""


class PlanningController:
    """MPPI over a dynamics model, which learns from the episode's pushes what no scene shows."""

    def __init__(
        self,
        dynamics: Dynamics,
        config: PlannerConfig,
        feasibility: Feasibility,
        learns: bool = True,
    ) -> None:
        """Plan with this model; `learns`: let it know the episode's earlier pushes."""
        self.model = as_rollout(dynamics)
        self.planner = Replanner(Planner(self.model, config, feasibility))
        self.learns = learns
        self.history: PushHistory | None = None

    def decide(self, scene: Scene, goal: Goal, random: np.random.Generator) -> Decision:
        """Plan and take the first push."""
        plan = self.planner.complete(scene, self.planner.plan(scene, goal, random))
        return Decision(plan.push, plan.predicted[0], plan.times.total)

    def refused(self, push: PushArray) -> None:
        """Plan again without pushes like this one."""
        self.planner.refuse(push)

    def observed(self, scene: Scene, push: PushArray, next_scene: Scene) -> None:
        """Plan from now on with a model that knows of this push."""
        if self.learns:
            past = self.history or PushHistory.empty(len(scene))
            self.history = past.then(scene, push, next_scene)
            self.planner.planner.model = informed_rollout(self.model, self.history)


ControllerMaker = Callable[[ScenarioScene], Controller]


def controller_maker(
    name: str,
    config: PlannerConfig | None = None,
    feasibility: Feasibility | None = None,
    learns: bool = True,
) -> ControllerMaker:
    """Return what makes a fresh controller for each scene; models are loaded once, here.

    Args:
        name: null, straight, random, oracle, or a dynamics that `load_dynamics` knows (planar,
            planar_axes, identity, sain, a checkpoint's path). The oracle is told the true friction.
        config: how to plan.
        feasibility: what the arm can do.
        learns: whether a model is told the episode's earlier pushes; the oracle never is.

    Raises:
        ConfigError: an empty name.
        CheckpointError: a checkpoint that cannot be loaded.
    """
    config, feasibility = config or PlannerConfig(), feasibility or Feasibility()
    if not name:
        raise ConfigError(f"a controller needs a name: {', '.join(BASELINES)} or a dynamics")
    if name == "null":
        return lambda scene: NullController()
    if name == "straight":
        return lambda scene: StraightController(feasibility)
    if name == "random":
        return lambda scene: RandomController(feasibility)
    if name == ORACLE:
        return lambda scene: PlanningController(
            PlanarPrior(PlanarConfig(friction=scene.friction)), config, feasibility, learns=False
        )
    dynamics = load_dynamics(name)
    return lambda scene: PlanningController(dynamics, config, feasibility, learns)
