"""One episode of a collection: a randomised world, a shadow beside it, up to ten pushes.

Paper, section III-B. An episode depends on the collection's seed and its own number alone.
"""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Final

import numpy as np

from sain_core.config import Config, option
from sain_core.errors import SainError
from sain_core.push import PaperGrid
from sain_core.scene import POSITION, TARGET
from sain_core.seeding import generator
from sain_core.types import PushArray
from sain_sim.outcome import PushOutcome
from sain_sim.parameters import FLAT, THREE_FEET, WorldParameters
from sain_sim.sampling import (
    CircleSampler,
    GridSampler,
    PushSampler,
    StartConfig,
    draw_start,
    wholly_on,
)
from sain_sim.shadow import NOMINAL, TRUE, BulletPrior
from sain_sim.shards import Transition
from sain_sim.truth import RANDOMISED_TRUTH, TruthConfig
from sain_sim.world import World, WorldConfig

MOVED: Final = 0.002  # [m], the paper's threshold for the target (section III-B b)
CIRCLE: Final = "circle"
GRID: Final = "grid"


@dataclass(frozen=True)
class EpisodeConfig(Config):
    """What episodes are like."""

    disks: int = option(2, "number of disks N", minimum=2, maximum=5)
    shape: str = option(THREE_FEET, "how disks are built", choices=(THREE_FEET, FLAT))
    sampler: str = option(
        CIRCLE, "pushes from any side, or the paper's grid", choices=(CIRCLE, GRID)
    )
    pushes: int = option(10, "most pushes in an episode", minimum=1, maximum=100)
    tries: int = option(
        50, "pushes drawn for each step before an episode ends early", minimum=1, maximum=10_000
    )
    moved_only: bool = option(
        False, "keep only transitions whose target moved by 2 mm, as the paper does"
    )
    floor_episodes: int = option(
        0, "repeat the pushes of the first so many episodes with the true parameters", minimum=0
    )
    truth: TruthConfig = RANDOMISED_TRUTH


class EpisodeRunner:
    """Runs episodes one after the other in worlds that it keeps."""

    def __init__(self, seed: int, config: EpisodeConfig) -> None:
        """Build the worlds.

        Args:
            seed: of the collection.
            config: what the episodes are like.
        """
        self._seed = seed
        self._config = config
        self._world_config = WorldConfig()
        self._sampler: PushSampler = CircleSampler()
        if config.sampler == GRID:
            self._sampler = GridSampler(PaperGrid())
        self._world = World(_draw_parameters(generator(seed, "build"), config), self._world_config)
        self._shadow = BulletPrior(NOMINAL, self._world_config, self._world.parameters)

    def run(self, episode: int) -> list[Transition]:
        """Return the transitions of one episode, in order."""
        random = generator(self._seed, "episode", episode)
        parameters = _draw_parameters(random, self._config)
        table = self._world_config.feasibility.table
        self._world.reset(draw_start(random, parameters, StartConfig(), table), parameters)
        with ExitStack() as stack:
            floor = None
            if episode < self._config.floor_episodes:
                floor = stack.enter_context(BulletPrior(TRUE, self._world_config, parameters))
            pushes = self._pushes(random)
            kept = (self._transition(episode, *item, floor) for item in enumerate(pushes))
            return [item for item in kept if item.moved or not self._config.moved_only]

    def _pushes(self, random: np.random.Generator) -> Iterator[tuple[PushArray, PushOutcome]]:
        """Carry out pushes until there are enough, none is possible, or a disk leaves the table."""
        table = self._world_config.feasibility.table
        for _ in range(self._config.pushes):
            done = self._push(random)
            if done is None:
                return
            if not done[1].settled or not wholly_on(done[1].after, table):
                return  # what happens at the edge is not in a plane
            yield done

    def _push(self, random: np.random.Generator) -> tuple[PushArray, PushOutcome] | None:
        """Draw pushes until one can be carried out; None when none could."""
        scene = self._world.observe()
        for _ in range(self._config.tries):
            push = self._sampler.draw(random, scene)
            try:
                return push, self._world.push(push)
            except SainError:  # unreachable or blocked: draw another
                continue
        return None

    def _transition(
        self,
        episode: int,
        step: int,
        done: tuple[PushArray, PushOutcome],
        floor: BulletPrior | None,
    ) -> Transition:
        push, outcome = done
        before, after = outcome.before, outcome.after
        again = np.full_like(before, np.nan) if floor is None else floor.predict(before, push)
        parameters = self._world.parameters
        travel = np.linalg.norm(after[TARGET, POSITION] - before[TARGET, POSITION])
        return Transition(
            state=before.ravel(),
            action=push,
            physics_next=self._shadow.predict(before, push).ravel(),
            next_state=after.ravel(),
            floor_next=again.ravel(),
            episode=episode,
            step=step,
            seed=self._seed,
            masses=np.array(parameters.masses),
            radii=np.array(parameters.radii),
            friction=parameters.friction,
            rim_friction=parameters.rim_friction,
            tool_friction=parameters.tool_friction,
            moved=bool(travel >= MOVED),
            duration=outcome.duration,
            roughness=parameters.roughness.arrays(),
        )

    def close(self) -> None:
        """Let go of the worlds."""
        self._world.close()
        self._shadow.close()


def _draw_parameters(random: np.random.Generator, config: EpisodeConfig) -> WorldParameters:
    return config.truth.draw(random, config.disks, config.shape)
