"""Several environments at once are as each alone."""

import gymnasium
import numpy as np
import pytest

from sain_core.errors import InvalidInputError
from sain_core.push import LENGTH, idle_pushes

COUNT = 2


MODES = {
    "fork": {"vectorization_mode": "async"},
    "spawn": {"vectorization_mode": "async", "vector_kwargs": {"context": "spawn"}},
}


@pytest.fixture(params=MODES)
def envs(request):
    """Two environments."""
    mode = MODES[request.param]
    made = gymnasium.make_vec("sain/Push-v0", num_envs=COUNT, scenario="anywhere", **mode)
    yield made
    made.close()


def test_each_is_as_if_alone(envs, make):
    """Where an episode has ended, the next step begins another one."""
    seeds = [5, 11]
    envs.action_space.seed(1)
    actions = [envs.action_space.sample() for _ in range(25)]
    together = [envs.reset(seed=seeds), *map(envs.step, actions)]
    for index, seed in enumerate(seeds):
        env = make(scenario="anywhere")
        alone = [env.reset(seed=seed)]
        for action in actions:
            alone.append(env.reset() if env.episode.over else env.step(action[index]))
        for many, one in zip(together, alone, strict=True):
            assert {key: rows[index].tobytes() for key, rows in many[0].items()} == {
                key: rows.tobytes() for key, rows in one[0].items()
            }
            for name in ("distance", "refusal", "scene_seed", "pushes"):
                assert many[-1][name][index] == one[-1][name]
        assert env.episode.case.seed != seed


def test_nan_for_one_is_an_error(envs):
    envs.reset(seed=0)
    actions = idle_pushes(COUNT)
    actions[1, LENGTH] = np.nan
    with pytest.raises(InvalidInputError, match="length of the action is nan; it must be finite"):
        envs.step(actions)
    envs.close()
    envs.close()  # the fixture does it again
