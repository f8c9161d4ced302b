"""Environments that are closed after each test."""

from typing import Any

import gymnasium
import pytest

import sain_gym  # noqa: F401  (registers the environment)
from sain_gym.push_env import PushEnv


@pytest.fixture
def make():
    """Makes environments without wrappers; all settings may be given."""
    made: list[PushEnv] = []

    def make_env(**settings: Any) -> PushEnv:
        env = gymnasium.make("sain/Push-v0", **settings).unwrapped
        assert isinstance(env, PushEnv)
        made.append(env)
        return env

    yield make_env
    for env in made:
        env.close()
