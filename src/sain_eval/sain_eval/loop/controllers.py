"""Who decides the pushes: agents that plan over any dynamics, and baselines, by their names."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from sain_core.errors import ConfigError, NoPushError
from sain_core.feasibility import Feasibility
from sain_core.model import as_observed, load_dynamics
from sain_core.push import BODY, LOCATION, make_push
from sain_core.scene import MID, POSITION, TARGET, wrap_angle
from sain_eval.scenes.scenario_scene import ScenarioScene
from sain_mppi.agent.agent import Agent, AgentConfig, planning_agent
from sain_mppi.agent.events import PlanJob, PushDecision
from sain_mppi.agent.planning import Decider

if TYPE_CHECKING:
    from sain_model.physics.planar import PlanarPrior

ORACLE: Final = "oracle"
RANDOM_DRAWS: Final = 256


class NullDecider(Decider):
    """Does nothing: what a scene is worth by itself."""

    def decide(self, job: PlanJob, generator: np.random.Generator) -> PushDecision:
        """Raise `NoPushError`."""
        raise NoPushError("the controller null never pushes")


class StraightDecider(Decider):
    """Pushes the mid disk towards the goal, as far as a push goes, without looking at contacts."""

    def __init__(self, feasibility: Feasibility) -> None:
        """Push within these limits."""
        self._limits = feasibility.limits

    def decide(self, job: PlanJob, generator: np.random.Generator) -> PushDecision:
        """Push along the line from mid disk to goal by the distance left for the target.

        Raises:
            NoPushError: this push was refused, or the goal is more than a place.
        """
        if not job.problem.goal.is_place:
            raise NoPushError(
                "the controller straight brings a target to a place, and the goal asks for more;"
                " choose random, planar or another model"
            )
        if job.refused:
            location = job.refused[-1][LOCATION]
            raise NoPushError(f"the straight push at {location:.2f} rad was refused")
        scene, goal = job.problem.scene, job.problem.goal.places[0]
        way = goal - scene[MID, POSITION]
        left = float(np.linalg.norm(goal - scene[TARGET, POSITION]))
        length = min(self._limits.clearance + left, self._limits.max_length)
        location = float(wrap_angle(np.arctan2(way[1], way[0])))
        return PushDecision(job, make_push(location, 0.0, length, speed=self._limits.speed))


class RandomDecider(Decider):
    """Pushes from anywhere to anywhere, as long as it is permitted."""

    def __init__(self, feasibility: Feasibility) -> None:
        """Push within what this permits."""
        self._feasibility = feasibility

    def decide(self, job: PlanJob, generator: np.random.Generator) -> PushDecision:
        """Draw one permitted push.

        Raises:
            NoPushError: none of many draws is permitted.
        """
        pushes = self._feasibility.limits.sample(generator, RANDOM_DRAWS)
        bodies = job.problem.bodies
        if bodies.pushable != (MID,):
            pushes[:, BODY] = generator.choice(bodies.pushable, RANDOM_DRAWS)
        pushes = pushes[job.problem.permitted(pushes)]
        if not len(pushes):
            raise NoPushError(f"none of {RANDOM_DRAWS} random pushes can be carried out")
        return PushDecision(job, pushes[0])


BASELINES: Final[dict[str, Callable[[Feasibility], Decider]]] = {
    "null": lambda feasibility: NullDecider(),
    "straight": StraightDecider,
    "random": RandomDecider,
}

AgentMaker = Callable[[ScenarioScene], Agent]


@cache
def agent_maker(name: str, config: AgentConfig = AgentConfig(), belief: str = "") -> AgentMaker:
    """Return a function that makes an agent for a scene; each model is loaded once in a process.

    The name is null, straight, random, oracle, a dynamics that an installed package offers (planar,
    sain, ...), or a checkpoint's path. A belief is for dynamics that take one. The oracle plans
    with the planar prior at the true friction, and never learns from earlier pushes.

    Raises:
        ConfigError: an empty or unknown name.
        CheckpointError: a checkpoint that cannot be loaded.
    """
    if not name:
        raise ConfigError(f"a controller needs a name: {', '.join(BASELINES)} or a dynamics")
    if name in BASELINES:
        return lambda scene: Agent(BASELINES[name](config.feasibility), config)
    physics = load_dynamics(config.prior)
    if name == ORACLE:
        blind = replace(config, history=False)
        return lambda scene: planning_agent(_true_physics(scene), physics, blind)
    model = load_dynamics(name)
    if belief and model.takes_belief:
        model = model.with_belief(Path(belief))
    model = as_observed(model, config.estimator.unknown)
    return lambda scene: planning_agent(model, physics, config)


def _true_physics(scene: ScenarioScene) -> "PlanarPrior":
    from sain_model.physics.planar import PlanarConfig, PlanarPrior  # loads Numba

    return PlanarPrior(PlanarConfig(friction=scene.friction))
