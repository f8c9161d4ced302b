import numpy as np
import pytest

from sain_core.errors import InvalidInputError, ModelUnavailableError
from sain_core.feasibility import Feasibility
from sain_core.history import PushHistory
from sain_core.scene import make_scene
from sain_mppi.loop.agent import Decider
from sain_mppi.loop.goal_tracker import Job, Task, View
from sain_mppi.loop.memory import MOST_PUSHES, EpisodeMemory
from sain_mppi.search.config import PlannerConfig

SCENE = make_scene(
    np.array([(0.40, 0.0), (0.541, 0.0)]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
)
PUSH = np.array([0.0, 0.1, 0.05])


def test_pushes_of_one_episode_are_remembered_in_order() -> None:
    memory = EpisodeMemory()
    for length in (0.05, 0.06):
        memory.add(7, SCENE, np.array([0.0, 0.0, length]), SCENE)
    past = memory.of(7, 2)
    assert past.action[:, 2].tolist() == [0.05, 0.06]
    assert len(memory.of(8, 2)) == len(memory.of(7, 3)) == 0
    assert memory.of(7, 3).disks == 3


def test_another_episode_begins_anew() -> None:
    memory = EpisodeMemory()
    memory.add(1, SCENE, PUSH, SCENE)
    memory.add(2, SCENE, PUSH, SCENE)
    assert (len(memory.of(1, 2)), len(memory.of(2, 2))) == (0, 1)


def test_the_oldest_pushes_are_forgotten() -> None:
    memory = EpisodeMemory()
    for number in range(MOST_PUSHES + 3):
        memory.add(1, SCENE, np.array([0.0, 0.0, 0.01 * number]), SCENE)
    past = memory.of(1, 2)
    assert len(past) == MOST_PUSHES
    assert past.action[0, 2] == pytest.approx(0.03)


def test_what_cannot_be_is_not_remembered() -> None:
    memory = EpisodeMemory()
    memory.add(1, SCENE, PUSH, SCENE)
    three = np.concatenate([SCENE, SCENE[1:]])
    for before, after in ((SCENE, SCENE * np.nan), (SCENE, SCENE + 0.1), (three, three)):
        with pytest.raises(InvalidInputError):
            memory.add(1, before, PUSH, after)
    assert len(memory.of(1, 2)) == 1


class Told:
    """Moves nothing, and keeps what it was told."""

    def __init__(self) -> None:
        self.told: list[int] = []

    def with_history(self, history: PushHistory) -> "Told":
        self.told.append(len(history))
        return self

    def rollout(self, scene: np.ndarray, pushes: np.ndarray) -> np.ndarray:
        return np.broadcast_to(scene, (*pushes.shape[:2], *scene.shape)).copy()


def test_a_plan_rests_on_its_own_episode_s_pushes() -> None:
    model, physics = Told(), Told()
    config = PlannerConfig(samples=16, rounds=1, horizon=1)
    decider = Decider(model, physics, config, Feasibility(), seed=0)
    job = Job(Task(1, 0, np.array([0.7, 0.0]), 0.01, 0), View(SCENE, 1, 1, True, 0.0), 0)
    decider.decide(job, PushHistory.empty().then(SCENE, PUSH, SCENE))
    decider.decide(job)
    assert (model.told, physics.told) == ([1, 0], [])  # physics was not asked


def test_physics_that_takes_over_knows_the_pushes_too() -> None:
    class Silent(Told):
        """Never answers."""

        def rollout(self, scene: np.ndarray, pushes: np.ndarray) -> np.ndarray:
            raise ModelUnavailableError("silent")

    physics = Told()
    config = PlannerConfig(samples=16, rounds=2, horizon=1)
    decider = Decider(Silent(), physics, config, Feasibility(), seed=0)
    job = Job(Task(1, 0, np.array([0.7, 0.0]), 0.01, 0), View(SCENE, 1, 1, True, 0.0), 0)
    decision = decider.decide(job, PushHistory.empty().then(SCENE, PUSH, SCENE))
    assert physics.told == [1]
    assert decider.complete(decision) is decision  # nothing is asked of a model that failed
