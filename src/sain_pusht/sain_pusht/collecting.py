"""Pushes made in gym-pusht, at random and in play, as a data set."""

import hashlib
from collections.abc import Callable, Iterator
from typing import Final

import numpy as np

from sain_core.errors import SainError
from sain_core.push import LENGTH
from sain_core.randomness import generator
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray, Scene
from sain_model.data.dataset import Dataset, Part
from sain_mppi.agent.agent import Agent
from sain_mppi.objective.problem import touching
from sain_pusht.agent import FEASIBILITY, LIMITS
from sain_pusht.world import PushtWorld, play_pusht

FIRST_SEED: Final = 100_000  # of episodes to learn from: far from those of evaluations
RANDOM_PUSHES: Final = 12  # in an episode at most
DRAWS: Final = 64

Row = tuple[Scene, PushArray, Scene, int]  # scene, push, next scene, episode


def random_pushes(episodes: int, world: PushtWorld, first: int = FIRST_SEED) -> Iterator[Row]:
    """Yield pushes at random, also short ones, of so many episodes from a seed on."""
    for seed in range(first, first + episodes):
        random, scene = generator(seed, "random pushes"), world.reset(seed)
        for _ in range(RANDOM_PUSHES):
            push = _draw(random, scene, world.bodies)
            if push is None or world.over:
                break
            try:
                after = world.push(push).after
            except SainError:
                continue  # the tool does not get there; nothing has moved
            if not world.over:  # an episode may end in the middle of a push
                yield scene, push, after, seed
            scene = after


def _draw(random: np.random.Generator, scene: Scene, bodies: Bodies) -> PushArray | None:
    pushes = LIMITS.sample(random, DRAWS)
    beyond = LIMITS.max_length - LIMITS.clearance
    pushes[:, LENGTH] = LIMITS.clearance + beyond * random.uniform(0.0, 1.0, DRAWS) ** 2
    pushes = pushes[touching(scene, pushes, FEASIBILITY, bodies)]
    return pushes[0] if len(pushes) else None


def played_pushes(
    episodes: int, world: PushtWorld, agent: Callable[[], Agent], first: int = FIRST_SEED
) -> Iterator[Row]:
    """Yield the pushes of an agent that plays so many episodes from a seed on."""
    for seed in range(first, first + episodes):
        pushes = play_pusht(seed, agent(), world).record.pushes
        whole = pushes[: len(pushes) - world.over]  # the last one was cut off
        yield from ((push.before, push.push, push.after, seed) for push in whole)


def data_set(rows: list[Row], bodies: Bodies) -> Dataset:
    """Return pushes as a data set of these bodies."""
    state, action, after = (np.array([row[column] for row in rows]) for column in range(3))
    digest = hashlib.sha256(state.tobytes() + action.tobytes() + after.tobytes())
    part = Part(
        state=state,
        action=action,
        next_state=after,
        physics_next=state,
        episode=np.array([row[3] for row in rows]),
        step=np.arange(len(rows)),
        friction=np.full(len(rows), np.nan),
        floor_next=np.full_like(state, np.nan),
        bodies=bodies,
    )
    return Dataset((part,), digest.hexdigest())
