"""Closed loops without ROS: the controllers, and an episode in a simulated world."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from inspect import getsourcefile
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from sain_core.errors import ConfigError, NoPushError
from sain_core.feasibility import Feasibility
from sain_core.model import as_observed, load_dynamics
from sain_core.policy import ANY, POLICY, Policy, Shapes, cameras_of, load_policy, no_camera
from sain_core.push import BODY, LOCATION, make_push
from sain_core.scene import MID, POSITION, TARGET, wrap_angle
from sain_core.storage import hash_files
from sain_core.types import PushArray, Scene
from sain_eval.episode import Tolerance
from sain_eval.loop.play import EpisodeOutcome, Sight, play
from sain_eval.scenes.families import ScenarioScene
from sain_mppi.agent.agent import Agent, AgentConfig, planning_agent
from sain_mppi.agent.events import PlanJob, PushDecision
from sain_mppi.agent.planning import Decider
from sain_mppi.agent.policy import PolicyDecider, TimedCall
from sain_sim.camera.camera import Camera, WorldCameraConfig
from sain_sim.world.own import open_world
from sain_sim.world.workcell import Sample, steps_of
from sain_sim.world.world import CheckedWorld

if TYPE_CHECKING:
    from sain_model.physics.planar import PlanarPrior


MOST_FRAMES: Final = 2000  # of one scene; an agent that needs more never decides


class CameraSight(Sight):
    """A camera above a world. Time goes on while it looks at bodies at rest."""

    world: CheckedWorld

    def __init__(self, world: CheckedWorld, config: WorldCameraConfig, seed: int) -> None:
        super().__init__(world)
        self._camera = None if config.is_exact else Camera(config)
        self._looked = 0.0  # [s], while the world stood still
        if self._camera is not None:
            self._camera.begin(seed, world.parameters)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.world.time + self._looked

    def look(self) -> Iterator[tuple[Scene, float]]:
        """Yield frames of a scene (N, 8) at rest as they arrive; exact observations are one."""
        camera, scene = self._camera, self.world.observe()
        if camera is None:
            yield scene, self.time
            return
        for _ in range(MOST_FRAMES):
            self._looked += camera.period
            camera.observe(scene, self.time)
            for frame in camera.arrived(self.time):
                yield frame.scene, frame.time

    def push(self, push: PushArray, seen: Scene) -> Scene:
        """Execute a push that was planned from a scene (N, 8), as seen; see `World.push`."""
        camera = self._camera
        if camera is None:
            return self.world.push(push).after
        watched = camera.config.delay > 0.0  # else frames of moving bodies are never of use
        every = steps_of(camera.period)
        outcome = self.world.push(push, self._watch if watched else None, every, seen)
        camera.count_push()
        return outcome.after

    def _watch(self, sample: Sample) -> None:
        if self._camera is not None:
            self._camera.observe(sample.scene, sample.time + self._looked, moving=True)


def run_episode(
    case: ScenarioScene,
    agent: Agent,
    tolerance: Tolerance | float,
    camera: WorldCameraConfig = WorldCameraConfig(),
) -> EpisodeOutcome:
    """Play one scene with an agent until all its goals are reached, or it stops.

    Each is to be reached within tolerance; a number is a distance [m]. The agent sees the world as
    the camera does. All that is returned is the truth.
    """
    parameters = case.parameters()
    goals = [Tolerance.of(tolerance).apply(goal) for goal in case.goals]
    with open_world(parameters, engine=case.truth.engine) as world:
        world.reset(case.disks)
        sight = CameraSight(world, camera, case.seed)
        return play(agent, sight, goals, parameters.bodies, case.max_pushes)


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
        self._limits = feasibility.limits

    def decide(self, job: PlanJob, generator: np.random.Generator) -> PushDecision:
        """Push along the line from mid disk to goal by the distance left for the target.

        Raises `NoPushError`: this push was refused, or the goal is more than a place.
        """
        if not job.problem.goal.is_place:
            raise NoPushError(
                "the controller straight brings a target to a place, and the goal asks for more;"
                " choose random, planar or another model"
            )
        if job.problem.refused:
            location = job.problem.refused[-1][LOCATION]
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
        self._feasibility = feasibility

    def decide(self, job: PlanJob, generator: np.random.Generator) -> PushDecision:
        """Draw one permitted push. Raises `NoPushError`: none of many draws is permitted."""
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
    sain, ...), a checkpoint's path, or ``policy:`` with a policy's name or path. A belief is for
    dynamics that take one. The oracle plans with the planar prior at the true friction, and never
    learns from earlier pushes.

    Raises `ConfigError`: an empty or unknown name; `CheckpointError`: a checkpoint that cannot be
    loaded.
    """
    if not name:
        raise ConfigError(f"a controller needs a name: {', '.join(BASELINES)} or a dynamics")
    if name in BASELINES:
        return lambda scene: Agent(BASELINES[name](config.feasibility), config)
    if name.startswith(POLICY):
        policy, call = _policy(name)
        own = name.removeprefix(POLICY)
        return lambda scene: Agent(PolicyDecider(policy, own, config, call), config)
    physics = load_dynamics(config.prior)
    if name == ORACLE:
        blind = replace(config, history=False)
        return lambda scene: planning_agent(_true_physics(scene), physics, blind)
    model = load_dynamics(name)
    if belief and model.takes_belief:
        model = model.with_belief(Path(belief))
    model = as_observed(model, config.estimator.unknown)
    return lambda scene: planning_agent(model, physics, config)


@cache
def _policy(name: str) -> tuple[Policy, TimedCall]:
    """Return a policy, which is loaded once in a process, and what asks it, one at a time."""
    policy = load_policy(name.removeprefix(POLICY))
    for key in cameras_of(policy.features):
        no_camera(f"{name}: {key}")
    return policy, TimedCall()


def features_of(name: str) -> Shapes:
    """Return the shapes that a policy of this name observes; empty: any, or it is no policy."""
    return _policy(name)[0].features if name.startswith(POLICY) else ANY


def version_of(name: str) -> str:
    """Return what tells apart the versions of a controller of this name; "": it has none.

    Of a policy that states none it is the SHA-256 of its source. Raises as `agent_maker`.
    """
    if name.startswith(POLICY):
        policy, _ = _policy(name)
        source = getsourcefile(type(policy))
        return policy.version or (hash_files([Path(source)]) if source else "")
    model = None if not name or name in (*BASELINES, ORACLE) else load_dynamics(name)
    return str(getattr(getattr(model, "origin", None), "model_hash", ""))


def _true_physics(scene: ScenarioScene) -> "PlanarPrior":
    from sain_model.physics.planar import PlanarConfig, PlanarPrior  # loads Numba

    return PlanarPrior(PlanarConfig(friction=scene.friction))
