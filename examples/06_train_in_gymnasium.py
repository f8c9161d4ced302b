"""Train a small policy in the environment: a linear map from places to pushes, by cross-entropy.

./env python examples/06_train_in_gymnasium.py [ROUNDS]

Each round draws policies about the best ones of the round before, plays the same scenes with all of
them in two worlds at a time, and prints their returns. At the end, the mean of the best plays
scenes that it has not seen.
"""

import sys
import time

import gymnasium
import numpy as np

import sain_gym  # noqa: F401  (registers the environment)
from sain_core.push import PATH, make_push

ROUNDS = int(sys.argv[1]) if len(sys.argv) > 1 else 20
POLICIES, BEST, SCENES, PUSHES = 24, 6, 4, 5
TEST_SCENES = range(20)

envs = gymnasium.make_vec(
    "sain/Push-v0", num_envs=2, vectorization_mode="async", scenario="paper_shift"
)
space = envs.single_action_space
SCALE = np.array([0.2, 0.2, 0.15])  # of location and angle [rad] and length [m]
WEIGHTS = (3, 4)  # three numbers of a push, from four features


def features(observation: dict[str, np.ndarray]) -> np.ndarray:
    """Return (2, 4): one, the way left, forward and to the left, and where the target is."""
    mid, target = observation["bodies"][:, 0, :2], observation["bodies"][:, 1, :2]
    left, apart = observation["goal"][:, 1, 1:3] - target, target - mid
    return np.column_stack([np.ones(2), left[:, 0] / 0.3, left[:, 1] / 0.03, apart[:, 1] / 0.03])


def play(pair: np.ndarray, scenes: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the returns (2,) of two policies (2, 3, 4) on two scenes, and their successes."""
    observation, info = envs.reset(seed=scenes)
    returns, solved, running = np.zeros(2), np.zeros(2, bool), np.ones(2, bool)
    for _ in range(PUSHES):
        raw = np.einsum("pij,pj->pi", pair, features(observation))
        numbers = np.clip(raw * SCALE, space.low[PATH], space.high[PATH])
        pushes = make_push(*numbers.T)
        observation, reward, terminated, truncated, info = envs.step(pushes)
        returns += running * reward
        solved |= running & info["is_success"]
        running &= ~(terminated | truncated)  # what an ended world does next does not count
    return returns, solved


def test(policy: np.ndarray) -> str:
    """Return how many scenes of an evaluation a policy solves."""
    pairs = zip(TEST_SCENES[::2], TEST_SCENES[1::2], strict=True)
    solved = sum(int(play(np.stack([policy] * 2), list(pair))[1].sum()) for pair in pairs)
    return f"{solved} of {len(TEST_SCENES)} test scenes solved"


random = np.random.default_rng(0)
mean, spread = np.zeros(WEIGHTS), np.ones(WEIGHTS)
begun = time.monotonic()
print(f"before: {test(mean)}")
for number in range(1, ROUNDS + 1):
    policies = mean + spread * random.standard_normal((POLICIES, *WEIGHTS))
    scenes = random.integers(1_000_000, 2_000_000, SCENES).tolist()
    scores = np.zeros(POLICIES)
    for first in range(0, POLICIES, 2):
        pair = slice(first, first + 2)
        scores[pair] = sum(play(policies[pair], [scene] * 2)[0] for scene in scenes) / SCENES
    best = policies[np.argsort(-scores)[:BEST]]
    mean, spread = best.mean(axis=0), best.std(axis=0) + 0.02
    bar = "#" * max(0, round(40 + 10 * scores.mean()))
    print(f"round {number:2}: mean return {scores.mean():6.2f}, best {scores.max():6.2f}  {bar}")
print(f"after {time.monotonic() - begun:.0f} s: {test(mean)}")
envs.close()
