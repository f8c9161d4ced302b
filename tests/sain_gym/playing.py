"""Episodes that several tests play."""

import hashlib
from typing import Any

import numpy as np

from sain_core.randomness import generator
from sain_gym.push_env import PushEnv


def random_actions(env: PushEnv, count: int, seed: int = 0) -> list[np.ndarray]:
    """Return so many actions, evenly over the space."""
    random = generator(seed, "actions")
    return [random.uniform(env.action_space.low, env.action_space.high) for _ in range(count)]


def played(env: PushEnv, seed: int, actions: list[np.ndarray]) -> list[Any]:
    """Return all that a seeded episode with these actions returns, until it ends."""
    steps: list[Any] = [env.reset(seed=seed)]
    for action in actions:
        steps.append(env.step(action))
        if steps[-1][2] or steps[-1][3]:
            steps.append(env.reset())
    return steps


def digest(steps: list[Any]) -> str:
    """Return a digest of all bytes of what an episode returned."""
    total = hashlib.sha256()
    for step in steps:
        for part in step:
            total.update(_bytes(part))
    return total.hexdigest()


def _bytes(part: Any) -> bytes:
    if isinstance(part, dict):
        return b"".join(key.encode() + _bytes(value) for key, value in part.items())
    return part.tobytes() if isinstance(part, np.ndarray) else repr(part).encode()
