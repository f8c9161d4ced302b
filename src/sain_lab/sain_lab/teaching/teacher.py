"""A teacher: an agent's decider that makes pushes which inform, within the planner's limits."""

from collections.abc import Callable
from typing import Final

import numpy as np

from sain_core.errors import NoPushError, SainError
from sain_core.feasibility import Feasibility
from sain_core.model import Model
from sain_core.scene import MASS, POSITION, RADIUS, unit
from sain_core.types import Mask, PushArray, Pushes, Scene
from sain_core.world import Outcome
from sain_eval.scenes.families import ScenarioScene
from sain_lab.teaching.information import Answers, Certainty, Work, answers, gains, variance_of
from sain_model.dynamics.sain import SainDynamics
from sain_mppi.agent.agent import AgentConfig, planning_agent
from sain_mppi.agent.events import PlanJob, PushDecision, Task
from sain_mppi.agent.planning import Decider
from sain_mppi.agent.play import play
from sain_mppi.config import CostWeights
from sain_mppi.objective.cost import Objective
from sain_mppi.objective.proposals import candidates, uniform

DRAWS: Final = 256  # pushes that one is chosen from
STILL: Final = 1e-3  # [m], a body that moves less is where it was
SIDES: Final = unit(np.linspace(-np.pi, np.pi, 8, endpoint=False))


class Teacher(Decider):
    """Chooses the push that informs most."""

    def __init__(self, model: Callable[[], SainDynamics], work: Work, draws: int = DRAWS) -> None:
        """Ask before each push what is believed, and choose from so many pushes."""
        self._model, self._work, self._draws = model, work, draws

    def decide(self, job: PlanJob, generator: np.random.Generator) -> PushDecision:
        """Choose a push whose outcome keeps all bodies in reach, whatever the parameters are.

        Raises:
            NoPushError: there is none.
        """
        scene, bodies = job.problem.scene, job.problem.bodies
        pushes = drawn_pushes(job, generator, self._draws)
        certainty = Certainty.of(self._model(), bodies, job.history)
        scenes = np.broadcast_to(scene, (len(pushes), *scene.shape))
        found = answers(certainty, bodies, scenes, pushes)
        safe = stays_in_reach(scene, found, job.problem.feasibility)
        if not safe.any():
            raise NoPushError(
                f"none of {len(pushes)} pushes is sure to keep the bodies in reach; move them"
                " towards the middle of the table, or reset the scene"
            )
        variance = variance_of(certainty, bodies, scenes, pushes, found.after)
        needs = self._work.needs(certainty)
        gained = np.where(safe, gains(found, variance, needs, certainty.root), -np.inf)
        return PushDecision(job, pushes[int(gained.argmax())])


def drawn_pushes(job: PlanJob, generator: np.random.Generator, count: int) -> Pushes:
    """Draw permitted pushes (B, 5): half of them anywhere, half as a planner would try.

    Raises:
        NoPushError: none is permitted.
    """
    objective = Objective(job.problem, CostWeights())
    half = [draw(objective, generator, 2 * count, 1)[:, 0] for draw in (uniform, candidates)]
    permitted = [part[job.problem.permitted(part)][: count // 2] for part in half]
    pushes = np.concatenate(permitted)
    if not len(pushes):
        raise NoPushError("no push can be carried out from here; move a body, or reset the scene")
    return pushes


def stays_in_reach(scene: Scene, found: Answers, feasibility: Feasibility) -> Mask:
    """Tell which pushes leave every body that they move on the table, with reach on all sides."""
    ends = np.concatenate([found.after[:, None], found.extremes], axis=1)  # (B, P, N, 8)
    places = ends[..., POSITION]
    moved = np.linalg.norm(places - scene[:, POSITION], axis=-1) > STILL
    around = ends[..., RADIUS, None, None] * SIDES  # (B, P, N, S, 2)
    inside = feasibility.table.contains(places[..., None, :] + around).all(axis=-1)
    inside &= feasibility.reach.contains(places)
    return np.asarray((inside | ~moved).all(axis=(1, 2)))


class ImaginedWorld:
    """A world in which what a model predicts comes true."""

    def __init__(self, model: Model) -> None:
        self._model, self._scene = model, np.empty((0, 8))

    def reset(self, start: Scene, /) -> Scene:
        """Begin with a scene (N, 8)."""
        self._scene = start.copy()
        return self.observe()

    def observe(self) -> Scene:
        """Return the scene (N, 8) as it is."""
        return self._scene.copy()

    def push(self, push: PushArray, *, seen: Scene | None = None) -> Outcome:
        """Let the predicted scene come true."""
        before = self._scene
        self._scene = self._model.step(before[None], push[None])[0]
        self._scene[:, MASS:] = before[:, MASS:]
        return Outcome(before, self.observe())


def imagined_work(cases: list[ScenarioScene], model: Model, config: AgentConfig) -> Work:
    """Return the pushes of plans in scenes with the same bodies, where a model is the truth.

    Raises:
        SainError: there is no plan in any of the scenes.
    """
    bodies = cases[0].bodies
    scenes: list[Scene] = []
    pushes: list[PushArray] = []
    model = model.with_bodies(bodies)
    for case in cases:
        world = ImaginedWorld(model)
        world.reset(case.disks)
        agent = planning_agent(model, model, config)
        played = play(agent, world, [Task(1, 0, case.goal, case.max_pushes)], bodies)
        for record in played.pursuits[0].pushes:
            scenes.append(record.before)
            pushes.append(record.push)
    if not scenes:
        raise SainError("no plan was found in any scene of the scenario")
    return Work(bodies, np.stack(scenes), np.stack(pushes))
