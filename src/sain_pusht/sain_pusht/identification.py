"""The prior of gym-pusht's physics, from pushes: mass distribution, centre of mass, friction.

Nothing slides on there: a block that is not pushed stops at once. The closest that the planar prior
has is a table with much friction. What is left to find out is how blocks turn: there, by their
inertia, and not by where they stand. So supports stand where they give the same turn.
"""

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sain_core.errors import SainError
from sain_core.push import LENGTH
from sain_core.randomness import generator
from sain_core.scene import POSITION, THETA, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray, Scene
from sain_model.data.dataset import Dataset, Part
from sain_model.inference.gauss_newton import fit
from sain_model.inference.kinds import Kind
from sain_model.physics.body_kernels import DISK_FEET, DISK_INERTIA
from sain_model.physics.planar import SHARE, PlanarConfig, PlanarPrior, body_table
from sain_mppi.agent.agent import Agent
from sain_mppi.objective.problem import touching
from sain_pusht.agent import AGENT_RADIUS, FEASIBILITY, LIMITS
from sain_pusht.block import BLOCK_RADIUS, pusht_bodies
from sain_pusht.world import PushtWorld, play_pusht

STICKY: Final = PlanarConfig(
    tool_radius=AGENT_RADIUS,
    friction=2.0,
    gravity=30.0,
    friction_scale=1.0,
    tool_restitution=0.0,
    acceleration=8.0,
    speed_factor=0.5,  # fitted when pushes had no speed of their own
    longest_step=1 / 120,
)
WIDE: Final = 10.0  # standard deviation of z beforehand: the pushes decide
STEPS: Final = 30  # of the fit, at most


@dataclass(frozen=True)
class Identified:
    """What the pushes tell.

    Attributes:
        gyration: radius of gyration, in units of the block's radius.
        centre: (x, y) of the centre of mass from the centroid, in the block's frame and radii.
        tool_friction: between disk and block.
    """

    gyration: float
    centre: tuple[float, float]
    tool_friction: float

    @property
    def prior(self) -> PlanarPrior:
        """The prior with these parameters."""
        bodies = pusht_bodies(self.gyration)
        supports = body_table(bodies).supports
        even = STICKY.inertia / DISK_INERTIA
        arm = supports[:, SHARE] @ np.hypot(supports[:, 0], supports[:, 1])
        config = replace(
            STICKY,
            tool_friction=self.tool_friction,
            foot_radius=float(DISK_FEET * even**0.5 * self.gyration / arm),
            centre_x=self.centre[0],
            centre_y=self.centre[1],
        )
        return PlanarPrior(config, bodies)


def textbook() -> Identified:
    """Return what is assumed before any push: a uniform T, friction as in the planar prior."""
    even = float(np.sqrt(pusht_bodies().shapes[0].inertia(1.0, 1.0)[2]))
    return Identified(even, (0.0, 0.0), PlanarConfig().tool_friction)


def identify(data: Part) -> Identified:
    """Return the parameters that explain pushes best."""
    first = textbook()
    prior, names = first.prior, ("foot_radius", "centre_x", "centre_y", "tool_friction")
    kind = Kind("sticky", prior, names, WIDE**2 * np.eye(len(names)))
    pushes = data.observed.in_episodes(np.zeros(len(data), np.int64))
    found = fit(kind, [pushes], np.zeros((1, len(names))), np.zeros(1, np.int64), STEPS)
    values = {name: float(value[0].round(6)) for name, value in kind.values(found.places).items()}
    return Identified(
        first.gyration * values["foot_radius"] / prior.config.foot_radius,
        (values["centre_x"], values["centre_y"]),
        values["tool_friction"],
    )


def errors(prior: PlanarPrior, data: Part) -> np.ndarray:
    """Return how far blocks come to lie from where they are predicted (M, 2).

    In mm: the distance, and the turn at the block's circumscribed circle.
    """
    off = prior.step(data.state, data.action) - data.next_state
    turned = np.abs(wrap_angle(off[:, 0, THETA]))
    away = np.linalg.norm(off[:, 0, POSITION], axis=-1)
    return 1e3 * np.stack([away, BLOCK_RADIUS * turned], axis=-1)


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
