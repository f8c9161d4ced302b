r"""Pushes a second of the Gymnasium environment, beside those of its bare worlds and gym-pusht.

    ./env python -m benchmarks.gym_speed

Two worlds on two cores: `gymnasium.make_vec` with worlds in processes, beside two processes that
only call `World.reset` and `World.push`. Both play the same episodes: scenes of `anywhere` with the
same random pushes, none of which is refused. Blocks are played in turns; ratios are of medians.
gym-pusht has random actions; its step is 0.1 s, ours a whole push until all is at rest.
"""

import argparse
import multiprocessing
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from multiprocessing.connection import Connection
from typing import Any, Final

import gym_pusht  # noqa: F401  (registers its environment)
import gymnasium
import numpy as np

import sain_gym  # noqa: F401  (registers ours)
from sain_core.errors import SainError
from sain_core.feasibility import Feasibility
from sain_core.scene import POSITION
from sain_core.seeding import generator
from sain_eval.scenes.scenarios import SCENARIOS
from sain_sim.world.truth import TruthConfig
from sain_sim.world.world import World

SCENARIO: Final = "anywhere"
WORLDS: Final = 2
PUSHES: Final = 15  # of an episode: as many as the scenario allows
TRIES: Final = 200
Episode = tuple[int, list[np.ndarray]]  # a scene and its pushes


def main() -> None:
    """Print the table; see the module."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=12, help="of each world in a block")
    parser.add_argument("--blocks", type=int, default=5)
    arguments = parser.parse_args()
    print(
        "| steps a second, median [smallest, largest block] | one process | two | ratio to bare |"
    )
    print("| --- | ---: | ---: | ---: |")
    for engine in ("bullet", "mujoco"):
        compare(engine, arguments.episodes, arguments.blocks)
    pusht = [pusht_speed(worlds, arguments.blocks) for worlds in (1, WORLDS)]
    print(f"| gym-pusht, 0.1 s each | {' | '.join(map(cell, pusht))} | |")


def compare(engine: str, count: int, blocks: int) -> None:
    """Print the rows of an engine."""
    lists = [drawn_episodes(engine, count, world) for world in range(WORLDS)]
    bare = {worlds: BareWorlds(engine, lists[:worlds]) for worlds in (1, WORLDS)}
    envs = {
        (observation, worlds): gymnasium.make_vec(
            "sain/Push-v0",
            num_envs=worlds,
            vectorization_mode="async" if worlds > 1 else "sync",
            scenario=SCENARIO,
            engine=engine,
            observation=observation,
            tolerance=1e-4,
        )
        for observation in ("state", "image")
        for worlds in (1, WORLDS)
    }
    works: dict[Any, Callable[[], None]] = {("bare", n): one.play for n, one in bare.items()}
    for (observation, worlds), env in envs.items():
        works[observation, worlds] = partial(play_in_gym, env, lists[:worlds])
    speeds = in_turns(works, {key: key[1] * count * PUSHES for key in works}, blocks)
    for env in envs.values():
        env.close()
    for one in bare.values():
        one.close()
    for name in ("bare", "state", "image"):
        row = [speeds[name, worlds] for worlds in (1, WORLDS)]
        share = np.median(row[1]) / np.median(speeds["bare", WORLDS])
        print(f"| {engine}, {name} | {' | '.join(map(cell, row))} | {share:.2f} |", flush=True)


def in_turns(
    works: dict[Any, Callable[[], None]], steps: dict[Any, int], blocks: int
) -> dict[Any, list[float]]:
    """Return the steps a second of each work in each block; the first is not counted."""
    speeds: dict[Any, list[float]] = {key: [] for key in works}
    for block in range(blocks + 1):
        for key, work in works.items():
            begun = time.perf_counter()
            work()
            if block:
                speeds[key].append(steps[key] / (time.perf_counter() - begun))
    return speeds


def drawn_episodes(engine: str, count: int, world: int) -> list[Episode]:
    """Return episodes of random pushes that can all be carried out, and leave all on the table."""
    found: list[Episode] = []
    seed = 1000 * world
    bare: World | None = None
    while len(found) < count:
        seed += 1
        case = SCENARIOS[SCENARIO].scene(seed).within(TruthConfig(engine=engine))
        bare = bare or World(case.parameters(), engine=engine)
        bare.reset(case.disks, case.parameters())
        pushes = drawn_pushes(bare, generator(seed, "gym_speed"))
        if len(pushes) == PUSHES:
            found.append((seed, pushes))
    if bare is not None:
        bare.close()
    return found


def drawn_pushes(world: World, random: np.random.Generator) -> list[np.ndarray]:
    """Return random pushes that were carried out in a world, fewer where no other one can be."""
    feasibility = Feasibility()
    made: list[np.ndarray] = []
    for push in feasibility.limits.sample(random, TRIES):
        scene = world.observe()
        if len(made) == PUSHES or not feasibility.table.contains(scene[:, POSITION]).all():
            break
        try:
            world.push(push)
        except SainError:
            continue
        made.append(push)
    return made if feasibility.table.contains(world.observe()[:, POSITION]).all() else []


def play_bare(engine: str, episodes: list[Episode], pipe: Connection) -> None:
    """Play the episodes in a bare world each time that the pipe says so."""
    first = SCENARIOS[SCENARIO].scene(episodes[0][0])
    with World(first.parameters(), engine=engine) as world:
        while pipe.recv():
            for seed, pushes in episodes:
                case = SCENARIOS[SCENARIO].scene(seed)
                world.reset(case.disks, case.parameters())
                for push in pushes:
                    world.push(push)
            pipe.send(True)


class BareWorlds:
    """Processes that each play their episodes in a bare world."""

    def __init__(self, engine: str, lists: Sequence[list[Episode]]) -> None:
        """Start them."""
        self._pipes, self._processes = [], []
        for episodes in lists:
            mine, theirs = multiprocessing.Pipe()
            process = multiprocessing.Process(target=play_bare, args=(engine, episodes, theirs))
            process.start()
            self._pipes.append(mine)
            self._processes.append(process)

    def play(self) -> None:
        """Play all episodes once, at the same time."""
        for pipe in self._pipes:
            pipe.send(True)
        for pipe in self._pipes:
            pipe.recv()

    def close(self) -> None:
        """End the processes."""
        for pipe, process in zip(self._pipes, self._processes, strict=True):
            pipe.send(False)
            process.join()


def play_in_gym(env: Any, lists: Sequence[list[Episode]]) -> None:
    """Play the episodes of each world in a vectorised environment."""
    for together in zip(*lists, strict=True):
        env.reset(seed=[seed for seed, _ in together])
        for pushes in zip(*(pushes for _, pushes in together), strict=True):
            *_, info = env.step(np.stack(pushes))
        assert info["pushes"].tolist() == [PUSHES] * len(lists), info


def pusht_speed(worlds: int, blocks: int, steps: int = 200) -> list[float]:
    """Return the steps a second of gym-pusht with random actions in each block."""
    mode = "async" if worlds > 1 else "sync"
    env = gymnasium.make_vec("gym_pusht/PushT-v0", num_envs=worlds, vectorization_mode=mode)
    with closing(env):
        env.reset(seed=0)
        env.action_space.seed(0)
        actions = [env.action_space.sample() for _ in range(steps)]

        def play() -> None:
            for action in actions:
                env.step(action)

        return in_turns({0: play}, {0: worlds * steps}, blocks)[0]


def cell(speeds: list[float]) -> str:
    """Return a median with the smallest and largest."""
    return f"{np.median(speeds):.0f} [{min(speeds):.0f}, {max(speeds):.0f}]"


if __name__ == "__main__":
    main()
