import numpy as np
import pytest

from sain_core.errors import InvalidInputError
from sain_core.push import LENGTH, make_push
from sain_core.scene import make_scene
from sain_mppi.agent.memory import MOST_PUSHES, EpisodeMemory

SCENE = make_scene(
    np.array([(0.40, 0.0), (0.541, 0.0)]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
)
PUSH = make_push(0.0, 0.1, 0.05)


def test_pushes_of_one_episode_are_remembered_in_order() -> None:
    memory = EpisodeMemory()
    for length in (0.05, 0.06):
        memory.add(7, SCENE, np.array([0.0, 0.0, length]), SCENE)
    past = memory.of(7, 2)
    assert past.action[:, LENGTH].tolist() == [0.05, 0.06]
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
    assert past.action[0, LENGTH] == pytest.approx(0.03)


def test_what_cannot_be_is_not_remembered() -> None:
    memory = EpisodeMemory()
    memory.add(1, SCENE, PUSH, SCENE)
    three = np.concatenate([SCENE, SCENE[1:]])
    for before, after in ((SCENE, SCENE * np.nan), (SCENE, SCENE + 0.1), (three, three)):
        with pytest.raises(InvalidInputError):
            memory.add(1, before, PUSH, after)
    assert len(memory.of(1, 2)) == 1
