"""Several environments in processes of their own are as each alone."""

import gymnasium
import numpy as np
import pytest

from sain_core.errors import InvalidInputError
from sain_core.push import LENGTH


def test_each_is_as_if_alone_and_nan_for_one_is_an_error(make):
    """Where an episode has ended, the next step begins another one."""
    seeds, spawn = [5, 11], {"vectorization_mode": "async", "vector_kwargs": {"context": "spawn"}}
    envs = gymnasium.make_vec("sain/Push-v0", num_envs=2, scenario="anywhere", **spawn)
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
    actions[0][1, LENGTH] = np.nan
    with pytest.raises(InvalidInputError, match="length of the action is nan; must be finite"):
        envs.step(actions[0])
    envs.close()
    envs.close()  # a second call does nothing
