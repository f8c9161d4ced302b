"""Pushes that inform most about the plans that a scenario needs, and what they brought.

Parameters of the physics are believed to be normally distributed: vectors z with a mean and a
covariance. Each push is predicted at the mean and at points one deviation away from it, along
independent directions (an unscented transform). Half the difference of two opposite points is how
the push answers to that direction; what both have in common is curvature, and counts as noise.
A push that is observed shrinks the covariance (Gauss, Kalman). Of many pushes the one is chosen
after which the pushes of typical plans are predicted best: least expected squared error.
Parameters that no plan's push answers to are worth nothing, however uncertain they are.
"""

from collections.abc import Callable, Generator, Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any, Final, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import NoPushError, SainError
from sain_core.feasibility import Feasibility
from sain_core.model import Model
from sain_core.scene import MASS, POSITION, RADIUS, is_settled, unit
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import PushHistory
from sain_core.types import Mask, PushArray, Pushes, Scalars, Scene, Scenes
from sain_core.world import AnyWorld, Outcome
from sain_eval.loop.play import Sight, play
from sain_eval.scenes.families import ScenarioScene
from sain_eval.scenes.scenarios import draw_scene
from sain_lab.learner import Learner, error_of
from sain_lab.settings import TeachOptions
from sain_lab.storage.results import Result
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.evidence import SIZE, TAIL, ObservedPushes, errors_of
from sain_model.inference.kinds import Kind
from sain_model.inference.posterior import STEPS, fit
from sain_mppi.agent.agent import MOST_PUSHES, Agent, AgentConfig, planning_agent
from sain_mppi.agent.events import PlanJob, PushDecision
from sain_mppi.agent.planning import Decider
from sain_mppi.config import CostWeights
from sain_mppi.objective.cost import Objective
from sain_mppi.objective.proposals import candidates, uniform
from sain_sim.world.own import open_world
from sain_sim.world.workcell import WorldConfig

HEAVY: Final = (TAIL + SIZE + 2) / (TAIL + SIZE)  # variance that Student's t is worth, in scales^2


@dataclass(frozen=True, eq=False)
class Certainty:
    """How certain the parameters of a kind of physics are."""

    kind: Kind  # of physics
    place: Float[ndarray, "D"]  # the most likely vector z
    covariance: Float[ndarray, "D D"]  # of z, in the episode that goes on
    factor: float = 1.0  # of the noise of pushes, see `sain_model.inference.evidence`

    @classmethod
    def of(cls, model: SainDynamics, bodies: Bodies, history: PushHistory) -> Self:
        """Return how certain a model is in an episode with these earlier pushes."""
        now = model.with_bodies(bodies).condition(history).now
        ((_, kind),) = now.by_kind
        place = now.places[0, : len(kind.names)]
        if len(history) == 0 or not kind.names:
            return cls(kind, place, kind.covariance)
        fitted = fit(kind, [model.with_bodies(bodies).observed(history)], place[None], STEPS)
        return cls(kind, fitted.places[0], fitted.covariance[0], float(fitted.factor[0]))

    def doubled(self, before: Self) -> Self:
        """Return how certain as many pushes more would make it, from what came since `before`."""
        information = np.linalg.inv(self.covariance)
        gained = information
        if before.kind.names == self.kind.names:
            sizes, directions = np.linalg.eigh(information - np.linalg.inv(before.covariance))
            gained = directions * np.maximum(sizes, 0.0) @ directions.T
        return replace(self, covariance=np.linalg.inv(information + gained))

    @property
    def named(self) -> dict[str, tuple[float, float]]:
        """The value of each parameter and its spread: of the logarithm, if it is a factor."""
        return self.kind.believing(self.place, self.covariance).stated

    @property
    def root(self) -> Float[ndarray, "D D"]:
        """L with L L^T the covariance: a column for each independent direction."""
        return np.asarray(np.linalg.cholesky(self.covariance))


@dataclass(frozen=True, eq=False)
class Answers:
    """How B pushes answer to what is not certain."""

    after: Scenes  # the predicted scenes (B, N, 8), at the mean
    extremes: Float[ndarray, "B P N 8"]  # those at the points one deviation away
    slopes: Float[ndarray, "B M D"]  # change of x, y and turn [m] of each body along each direction
    curvature: Float[ndarray, "B M"]  # variance [m^2] of what is not linear


def answers(certainty: Certainty, bodies: Bodies, scenes: Scenes, pushes: Pushes) -> Answers:
    """Return how pushes (B, A) from scenes (B, N, 8) answer to what is not certain."""
    kind, root = certainty.kind, certainty.root
    batch, count = len(pushes), len(root)
    points = np.concatenate([np.zeros((1, count)), root.T, -root.T])  # (P, D)
    rows = np.repeat(np.arange(batch), len(points))
    values = kind.values(np.tile(certainty.place + points, (batch, 1)))
    after = kind.step(bodies, scenes[rows], pushes[rows], values)
    after = after.reshape(batch, len(points), *scenes.shape[1:])
    off = errors_of(after[:, 1:], after[:, :1]).reshape(batch, 2, count, -1)
    slopes = (off[:, 0] - off[:, 1]) / 2  # (B, D, M)
    bends = (off[:, 0] + off[:, 1]) / 2
    return Answers(after[:, 0], after[:, 1:], np.swapaxes(slopes, 1, 2), (bends**2).sum(axis=1) / 2)


def variance_of(
    certainty: Certainty, bodies: Bodies, scenes: Scenes, pushes: Pushes, after: Scenes
) -> Float[ndarray, "B M"]:
    """Return the variance [m^2] of what is observed of pushes that lead to scenes (B, N, 8)."""
    episodes = np.zeros(len(pushes), np.int64)
    observed = ObservedPushes(scenes, pushes, after, episodes, bodies)
    scales = observed.scales(np.full((len(pushes), 1), certainty.factor))
    return np.asarray(np.repeat(HEAVY * scales**2, SIZE, axis=-1))


@dataclass(frozen=True, eq=False)
class Work:
    """Pushes of typical plans: from scenes (B, N, 8), all with these bodies."""

    bodies: Bodies
    scenes: Scenes
    pushes: Pushes

    def needs(self, certainty: Certainty) -> Float[ndarray, "D D"]:
        """Return what errors of parameters cost: z^T A z is the mean squared error [m^2] of places.

        What each episode has of its own is not counted: another episode has another value of it.
        The directions are those of z.
        """
        slopes = answers(certainty, self.bodies, self.scenes, self.pushes).slopes
        places = slopes.reshape(len(slopes), -1, SIZE, slopes.shape[-1])[:, :, :2]
        cost = np.einsum("bnid,bnie->de", places, places) / len(slopes)
        inverse = np.linalg.inv(certainty.root)
        cost = inverse.T @ cost @ inverse
        own = certainty.kind.of_episode
        return np.where(own[:, None] | own, 0.0, cost)


def gains(
    found: Answers, variance: Float[ndarray, "B M"], needs: Float[ndarray, "D D"], root: ndarray
) -> Scalars:
    """Return by how much each of B pushes would reduce the expected squared error [m^2] of work."""
    noise = (variance + found.curvature)[..., None] * np.eye(variance.shape[-1])
    slopes = found.slopes
    total = slopes @ np.swapaxes(slopes, 1, 2) + noise
    cost = root.T @ needs @ root
    benefit = slopes @ cost @ np.swapaxes(slopes, 1, 2)
    return np.asarray(np.trace(np.linalg.solve(total, benefit), axis1=1, axis2=2))


def expected_error(certainty: Certainty, needs: Float[ndarray, "D D"]) -> float:
    """Return the root of the squared error [m] of work that uncertain parameters leave."""
    return float(np.sqrt(max(np.trace(needs @ certainty.covariance), 0.0)))


DRAWS: Final = 256  # pushes that one is chosen from
STILL: Final = 1e-3  # [m], a body that moves less is where it was
SIDES: Final = unit(np.linspace(-np.pi, np.pi, 8, endpoint=False))


class InformativeDecider(Decider):
    """Chooses the push that informs most."""

    def __init__(self, model: Callable[[], SainDynamics], work: Work, draws: int = DRAWS) -> None:
        """Ask before each push what is believed, and choose from so many pushes."""
        self._model, self._work, self._draws = model, work, draws

    def decide(self, job: PlanJob, generator: np.random.Generator) -> PushDecision:
        """Choose a push whose outcome keeps all bodies in reach, whatever the parameters are.

        Raises `NoPushError`: there is none.
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

    Raises `NoPushError`: none is permitted.
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

    Raises `SainError`: there is no plan in any of the scenes.
    """
    bodies = cases[0].bodies
    scenes: list[Scene] = []
    pushes: list[PushArray] = []
    model = model.with_bodies(bodies)
    for case in cases:
        world = ImaginedWorld(model)
        world.reset(case.disks)
        agent = planning_agent(model, model, config)
        for record in play(agent, world, [case.goal], bodies, case.max_pushes).record.pushes:
            scenes.append(record.before)
            pushes.append(record.push)
    if not scenes:
        raise SainError("no plan was found in any scene of the scenario")
    return Work(bodies, np.stack(scenes), np.stack(pushes))


# --- a session ------------------------------------------------------------------------------------

NEVER: Final = 1e-4, 1e-3  # [m], [rad], tolerances that a push meets only by chance
PLANS: Final = 12  # scenes of the scenario that plans are imagined in
OTHERS: Final = 500_000  # between the seeds of scenes that pushes are made in, and imagined
PATIENCE: Final = 10  # scenes in a row without a possible push
PER_SCENE: Final = 8  # pushes before a scene is reset, where there is a simulator

Room = tuple[AnyWorld[Any], ScenarioScene]
Rooms = Generator[Room, None, None]
Believed = Callable[[], SainDynamics]


@dataclass(frozen=True)
class SessionResult:
    """What the pushes brought."""

    kind: str  # of physics that is the likeliest
    pushes: int  # that were made
    # by name, value and spread before and after
    parameters: Mapping[str, tuple[tuple[float, float], tuple[float, float]]]
    # [mm] of the later half of the pushes, with what was believed at first and then
    errors: tuple[float, float]
    # [mm], error of plans from uncertain parameters, now and after as many pushes more
    expected: tuple[float, float]


@dataclass
class Session:
    """Pushes that inform most, and the errors of what was believed on each."""

    model: Believed  # returns the physics as it is believed now
    work: Work  # pushes of typical plans
    learner: Learner | None = None  # learns from the results; None: another process does
    # [mm] of each push, with what was believed at first and then
    errors: list[tuple[float, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._first = self.model()
        self._last = PushHistory.empty(len(self.work.bodies))  # of the last scene

    def run(self, rooms: Rooms, settings: TeachOptions) -> SessionResult:
        """Make the pushes, in one room after another.

        Raises `NoPushError`: no push is possible in several rooms, or there is none any more.
        """
        without, why, agent = 0, "", AgentConfig(seed=settings.seed)
        for number, (world, case) in enumerate(rooms):
            before, left = len(self.errors), settings.pushes - len(self.errors)
            chooser = InformativeDecider(self.model, self.work)
            episode = f"teaching {settings.seed}/{number}"
            sight = Watched(world, self.judge, case.bodies, episode)
            goals, most = [case.goal.within(*NEVER)], min(PER_SCENE, left)
            why = play(Agent(chooser, agent), sight, goals, case.bodies, most).failure
            if self.learner is not None:
                self.learner.end_episode()
            without = 0 if len(self.errors) > before else without + 1
            if len(self.errors) >= settings.pushes or without >= PATIENCE:
                break
        if len(self.errors) < settings.pushes:
            raise NoPushError(f"{len(self.errors)} of {settings.pushes} pushes were made: {why}")
        return self._concluded()

    def judge(self, result: Result, history: PushHistory) -> None:
        """Take the errors on a push that nothing was learned from yet, and learn from it."""
        first, now = (error_of(model, result, history) for model in (self._first, self.model()))
        self.errors.append((first, now))
        arrays = result.before, result.push, result.after
        self._last = history.then(*arrays).latest(MOST_PUSHES)
        if self.learner is not None:
            self.learner.observe(result)

    def _concluded(self) -> SessionResult:
        empty = PushHistory.empty(len(self.work.bodies))
        # a learner beside this process conditions on the last scene's pushes still
        bodies, last = self.work.bodies, self._last if self.learner is None else empty
        before = Certainty.of(self._first, bodies, empty)
        after = Certainty.of(self.model(), bodies, last)
        needs, was = self.work.needs(after), before.named
        half = np.array(self.errors[len(self.errors) // 2 :])
        more = after.doubled(before)
        return SessionResult(
            after.kind.name,
            len(self.errors),
            {name: (was.get(name, value), value) for name, value in after.named.items()},
            (float(half[:, 0].mean()), float(half[:, 1].mean())),
            (1e3 * expected_error(after, needs), 1e3 * expected_error(more, needs)),
        )


class Watched(Sight):
    """A world whose pushes are judged and learned from."""

    def __init__(
        self,
        world: AnyWorld[Any],
        learn: Callable[[Result, PushHistory], None],
        bodies: Bodies,
        episode: str,
    ) -> None:
        super().__init__(world)
        self._learn, self._bodies, self._episode = learn, bodies, episode
        self._history = PushHistory.empty(len(world.observe()))

    def push(self, push: PushArray, seen: Scene) -> Scene:
        """Execute a push, and learn from it."""
        before = self.world.observe()
        after = super().push(push, seen)
        if is_settled(after):
            result = Result(push, before, after, bodies=self._bodies, episode=self._episode)
            self._learn(result, self._history)
            self._history = self._history.then(before, push, after)
        return after


def scene_of(settings: TeachOptions, seed: int) -> ScenarioScene:
    """Return a scene of the scenario in its world, with the bodies that it has there."""
    case = draw_scene(settings.scenario, seed).within(settings.truth)
    return replace(case, shapes=case.parameters().shapes)


def work_of(settings: TeachOptions, model: SainDynamics) -> Work:
    """Return pushes of plans for the scenario, as a model imagines them."""
    first = settings.seed + OTHERS
    cases = [scene_of(settings, first + number) for number in range(PLANS)]
    alike = [case for case in cases if case.bodies == cases[0].bodies]
    return imagined_work(alike, model, AgentConfig())


def teach_in_world(settings: TeachOptions) -> SessionResult:
    """Make the pushes in a simulated world.

    Raises `SainError`: no push is possible, or the laboratory cannot be opened.
    """
    with Learner.named(settings.laboratory) as learner:
        model = lambda: learner.state.believer.model  # noqa: E731
        work = work_of(settings, model())
        with closing(rooms_of(settings)) as rooms:
            result = Session(model, work, learner).run(rooms, settings)
        learner.wait()
        return result


def rooms_of(settings: TeachOptions) -> Rooms:
    """Yield simulated worlds with scenes of the scenario."""
    for seed in count(settings.seed):
        case = scene_of(settings, seed)
        with open_world(case.parameters(), WorldConfig(), engine=case.truth.engine) as world:
            world.reset(case.disks)
            yield world, case
