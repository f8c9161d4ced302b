"""Our planner for judo's cylinder_push, with a prior that is fitted to its own pushes there."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.optimize import minimize

from benchmarks.cylinder_world import ROOM, SCALE, CylinderPace, CylinderWorld
from sain_core.feasibility import Feasibility
from sain_core.model import Model, RolloutModel
from sain_core.push import LENGTH, PushLimits
from sain_core.scene import POSITION, Table
from sain_core.seeding import generator
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scalars, Scenes
from sain_model.physics.planar import PlanarPrior
from sain_model.physics.planar_config import PlanarConfig
from sain_mppi.agent.agent import Agent, AgentConfig, planning_agent
from sain_mppi.agent.goal_tracker import GoalTrackerConfig
from sain_mppi.algorithms.config import PlannerConfig, ProgressConfig
from sain_mppi.objective.problem import touching
from sain_pusht.agent import SquareReach

PUSHER: Final = 0.25 * SCALE  # [m], the radius of judo's pusher
LIMITS: Final = PushLimits(max_angle=0.15, max_length=0.3, clearance=0.002, tool_radius=PUSHER)
EDGE: Final = 0.8 * SCALE * ROOM.high
FEASIBILITY: Final = Feasibility(
    limits=LIMITS,
    reach=SquareReach(inner=0.0, outer=10.0, low=-EDGE, high=EDGE),
    table=Table(x_min=-EDGE, x_max=EDGE, y_min=-EDGE, y_max=EDGE),
)
PLANNER: Final = PlannerConfig(
    samples=256,
    horizon=3,
    ahead=False,  # time stands still while the agent plans
    progress=ProgressConfig(give_up_after=0),
)
SOFT: Final = 0.2  # [mm], errors far below this hardly count
ORACLE_PLANNER: Final = replace(PLANNER, samples=80, horizon=1, thinning=1.0)
FIRST_SEED: Final = 100_000  # of episodes to learn from
PACE: Final = CylinderPace()
TEXTBOOK_TABLE: Final = PlanarConfig(
    tool_radius=PUSHER,
    clearance=LIMITS.clearance,
    speed_factor=SCALE * PACE.pushing / 0.2,
    tool_friction=0.01,  # of judo's cylinders
    tool_restitution=0.0,
)


def cylinder_agent(model: RolloutModel, planner: PlannerConfig = PLANNER) -> Agent:
    """Return the agent that plays with a model."""
    config = AgentConfig(
        history=False,
        planner=planner,
        goal_tracker=GoalTrackerConfig(max_refusals=30),
        feasibility=FEASIBILITY,
    )
    return planning_agent(model, model, config)


class CylinderOracle(Model):
    """A `Model` that is judo's own physics: an upper bound for models."""

    def __init__(self) -> None:
        """Make a copy of the world."""
        self._world = CylinderWorld(LIMITS)

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Return the scenes (B, 1, 8) after pushes (B, 5), one after another."""
        after = scenes.copy()
        for index in np.flatnonzero(pushes[:, LENGTH] > 0.0):
            after[index] = self._world.imagine(scenes[index], pushes[index])
        return after


def own_pushes(world: CylinderWorld, episodes: int, each: int = 6) -> tuple[Scenes, Pushes, Scenes]:
    """Return scenes, pushes at random and what they led to, of episodes made to learn from."""
    rows = list(_random_pushes(world, episodes, each))
    scenes, pushes, after = (np.array(column) for column in zip(*rows, strict=True))
    return scenes, pushes, after


def _random_pushes(
    world: CylinderWorld, episodes: int, each: int
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    for seed in range(FIRST_SEED, FIRST_SEED + episodes):
        random, scene = generator(seed, "cylinder push"), world.reset(seed)
        for _ in range(each):
            pushes = LIMITS.sample(random, 64)
            pushes[:, LENGTH] = np.maximum(pushes[:, LENGTH] ** 2 / 0.3, 2 * LIMITS.clearance)
            pushes = pushes[touching(scene, pushes, FEASIBILITY, Bodies.disks(1))]
            if world.over or not len(pushes):
                break
            push = pushes[0]
            after = world.push(push)
            if world.over:
                break
            yield scene, push, after
            scene = after


def fit_prior(scenes: Scenes, pushes: Pushes, after: Scenes) -> PlanarPrior:
    """Return the prior that predicts pushes best: radius of the tool, and frictions.

    Carts there are slowed by drag, which the prior does not have; its friction stands in. A stroke
    ends so slowly that the cart stays in touch, so the tool slows down as the friction does.
    """

    def known(numbers: Scalars) -> PlanarPrior:
        radius, friction, tool_friction = numbers
        table = float(np.clip(np.exp(friction), 0.011, 2.0))
        config = replace(
            TEXTBOOK_TABLE,
            tool_radius=PUSHER + 1e-3 * max(float(radius), -20.0),
            friction=table,
            tool_friction=abs(float(tool_friction)),
            acceleration=TEXTBOOK_TABLE.gravity * table,
        )
        return PlanarPrior(config)

    def cost(numbers: Scalars) -> float:
        off = push_errors(known(numbers), scenes, pushes, after)
        return float(np.sqrt(SOFT**2 + off**2).mean())

    first = np.array([2.0, np.log(0.03), 0.01])
    simplex = np.vstack([first, first + np.diag([2.0, 0.7, 0.05])])
    options = {"initial_simplex": simplex, "xatol": 1e-3, "fatol": 1e-4, "maxfev": 150}
    return known(minimize(cost, first, method="Nelder-Mead", options=options).x)


def push_errors(prior: PlanarPrior, scenes: Scenes, pushes: Pushes, after: Scenes) -> Scalars:
    """Return how far [mm] in our units carts come to rest from where they are predicted."""
    off = (prior.step(scenes, pushes) - after)[:, 0, POSITION]
    return np.asarray(1e3 * np.linalg.norm(off, axis=-1))
