"""So many pushes that inform most, scene after scene, and what they brought."""

from collections.abc import Callable, Generator, Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any, Final

import numpy as np

from sain_core.errors import NoPushError
from sain_core.scene import is_settled
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import PushHistory
from sain_core.types import PushArray, Scene
from sain_core.world import AnyWorld
from sain_eval.scenes.families import ScenarioScene
from sain_eval.scenes.scenarios import draw_scene
from sain_lab.contenders import error_of
from sain_lab.exploration.information import (
    Certainty,
    InformativeDecider,
    Work,
    expected_error,
    imagined_work,
)
from sain_lab.learner import Learner
from sain_lab.settings import TeachOptions
from sain_lab.storage.results import Result
from sain_model.dynamics.sain import SainDynamics
from sain_mppi.agent.agent import MOST_PUSHES, Agent, AgentConfig
from sain_mppi.agent.events import Task
from sain_mppi.agent.play import Sight, play
from sain_sim.world.own import open_world
from sain_sim.world.workcell import WorldConfig

NEVER: Final = 1e-4, 1e-3  # [m], [rad], tolerances that a push meets only by chance
PLANS: Final = 12  # scenes of the scenario that plans are imagined in
OTHERS: Final = 500_000  # between the seeds of scenes that pushes are made in, and imagined
PATIENCE: Final = 10  # scenes in a row without a possible push
PER_SCENE: Final = 8  # pushes before a scene is reset, where there is a simulator

Room = tuple[AnyWorld[Any], ScenarioScene]
Rooms = Generator[Room, None, None]
Model = Callable[[], SainDynamics]


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

    model: Model  # returns the physics as it is believed now
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
            task = Task(1, 0, case.goal.within(*NEVER), min(PER_SCENE, left))
            why = play(Agent(chooser, agent), sight, [task], case.bodies).failure
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
        first, now = (error_of(model, result, history)[0] for model in (self._first, self.model()))
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
