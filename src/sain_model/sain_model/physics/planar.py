"""The planar prior: a batched contact simulator of disks on a table, without an arm.

It is the fast f_p of the paper's equation 2 that can sit inside every rollout. It believes the
mass and radius that the scene states and, unless told better, the nominal friction.
"""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Final, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.dynamics import Dynamics, IdentityPrior
from sain_core.history import PushHistory
from sain_core.model_checks.response_check import answering, check_step
from sain_core.push import PushLimits, pushed_bodies
from sain_core.scene import MASS, MID, POSITION, RADIUS, TARGET
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Indices, Pushes, Scalars, Scenes
from sain_model.compute.batch_checks import check_batch
from sain_model.compute.compiling import plain
from sain_model.compute.kernel_progress import compile_visibly
from sain_model.compute.thread_pool import run_blocks
from sain_model.physics.body_kernels import Physics
from sain_model.physics.corrections import (
    Corrections,
    check_corrections,
    corrected_disks,
    corrected_pushes,
)
from sain_model.physics.friction import FrictionConfig, FrictionFilter
from sain_model.physics.outlines import Touched, push_bodies
from sain_model.physics.planar_config import PlanarConfig, with_mass_ratio
from sain_model.physics.planar_kernels import CHUNK, push_block, push_conditioned_block

NOMINAL_MASS: Final = 8.0  # [kg], the paper, section III-A
NOMINAL_MID_RADIUS: Final = 0.08  # [m]
NOMINAL_RADIUS: Final = 0.06  # [m], of every other disk


@dataclass(frozen=True)
class PlanarPrior:
    """Predicts pushes by simulating them in the plane. A `Dynamics`."""

    config: PlanarConfig = PlanarConfig()
    bodies: Bodies = PAPER_DISKS  # that are pushed

    def __post_init__(self) -> None:
        """See that the kernels are compiled: no plan is to wait for them."""
        compile_visibly()

    @cached_property
    def _physics(self) -> Physics:
        return self.config.physics()

    def at(self, friction: float) -> Self:
        """Return this prior with another friction between disks and table."""
        return replace(self, config=replace(self.config, friction=friction))

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return this prior for scenes of these bodies."""
        return replace(self, bodies=bodies)

    def with_history(self, history: PushHistory) -> Self:
        """Return this prior with the friction that an episode's earlier pushes tell of."""
        return self.at(self.filter().infer(history).mean)

    def filter(self, config: FrictionConfig = FrictionConfig()) -> FrictionFilter:
        """Return what infers friction with this prior, about the one that it assumes."""
        return _filter(self, config)

    def step(self, scenes: Scenes, pushes: Pushes, friction: Scalars | None = None) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes (B, 3 or 4) from scenes (B, N, 8).

        Args:
            scenes: settled scenes; velocities are taken as zero.
            pushes: one push a scene. Length 0 leaves the scene unchanged, bit for bit.
            friction: with the table (B,), where it is known; the configured one if not.

        Raises:
            InvalidInputError: wrong shapes, NaN or Inf.
        """
        return self.step_with_contacts(scenes, pushes, friction)[0]

    def step_conditioned(
        self,
        scenes: Scenes,
        pushes: Pushes,
        corrections: Corrections,
        friction: Scalars | None = None,
    ) -> Scenes:
        """Predict as `step`, told what is unlike the textbook (`sain_model.physics.corrections`).

        Raises:
            InvalidInputError: wrong shapes, NaN or Inf.
        """
        check_batch(scenes, pushes, friction, self.bodies)
        check_corrections(corrections, scenes)
        if not self._of_disks:
            return self._push_bodies(scenes, pushes, friction, corrections)[0]
        start = self._tool_distance(scenes, pushes)
        pushes, told = corrected_pushes(pushes, corrections), corrected_disks(corrections)
        return self._simulate(scenes, pushes, friction, start, told)[0]

    def step_with_contacts(
        self, scenes: Scenes, pushes: Pushes, friction: Scalars | None = None
    ) -> tuple[Scenes, Touched]:
        """As `step`, and tell for each push which bodies the tool touched, (B, N)."""
        check_batch(scenes, pushes, friction, self.bodies)
        if not self._of_disks:
            return self._push_bodies(scenes, pushes, friction)
        start = self._tool_distance(scenes, pushes)
        return self._simulate(scenes, pushes, friction, start)

    def step_as_nominal(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Predict as `step`, believing that every body has nominal mass, every disk nominal radius.

        The tool moves as it does in truth: its way comes from the scene's own radii. Overlaps of
        disks that are believed too large are undone without giving them speed.
        """
        check_batch(scenes, pushes, None, self.bodies)
        believed = scenes.copy()
        believed[..., MASS] = NOMINAL_MASS
        if self._of_disks:
            believed[..., RADIUS] = NOMINAL_RADIUS
            believed[:, MID, RADIUS] = NOMINAL_MID_RADIUS
            start = self._tool_distance(scenes, pushes)
            predicted, _ = self._simulate(believed, pushes, None, start)
        else:
            predicted, _ = self._push_bodies(believed, pushes, None)
        predicted[..., MASS:] = scenes[..., MASS:]
        return predicted

    @property
    def _of_disks(self) -> bool:
        return takes_disks(self.bodies)

    def _push_bodies(
        self,
        scenes: Scenes,
        pushes: Pushes,
        friction: Scalars | None,
        corrections: Corrections | None = None,
    ) -> tuple[Scenes, Touched]:
        """Run the kernels for bodies of any shape."""
        if friction is None:
            friction = np.full(len(scenes), self.config.friction)
        limits = PushLimits(tool_radius=self.config.tool_radius, clearance=self.config.clearance)
        world, weighed = (self.bodies, limits, self._physics), self._weighed(scenes)
        after, touched = push_bodies(weighed, pushes, friction, *world, corrections)
        after[..., MASS] = scenes[..., MASS]
        return after, touched

    def _weighed(self, scenes: Scenes) -> Scenes:
        return with_mass_ratio(scenes, self.config.mass_ratio)

    def _tool_distance(self, scenes: Scenes, pushes: Pushes) -> Scalars:
        """Return how far from the pushed disk's centre the tool's axis starts, (B,) [m]."""
        radius = scenes[np.arange(len(scenes)), pushed_bodies(pushes), RADIUS]
        return np.asarray(radius + self.config.tool_radius + self.config.clearance)

    def _simulate(
        self,
        scenes: Scenes,
        pushes: Pushes,
        friction: Scalars | None,
        start: Scalars,
        told: Float[ndarray, "B N 7"] | None = None,
    ) -> tuple[Scenes, Touched]:
        """Run the kernels on a copy, the extra disks in an order of their own."""
        batch = len(scenes)
        if friction is None:
            friction = np.full(batch, self.config.friction)
        order = disks_first(scenes, pushed_bodies(pushes))
        after = np.ascontiguousarray(np.take_along_axis(self._weighed(scenes), order, axis=1))
        touched = np.zeros(scenes.shape[:2], dtype=bool)
        rows = after, plain(pushes), plain(friction), start
        corrections = None if told is None else np.take_along_axis(told, order, axis=1)

        def work(first: int) -> None:
            if corrections is None:
                push_block(first, *rows, self._physics, touched)
            else:
                push_conditioned_block(first, *rows, self._physics, touched, corrections)

        run_blocks(work, batch, CHUNK)
        predicted, pressed = np.empty_like(after), np.empty_like(touched)
        np.put_along_axis(predicted, order, after, axis=1)
        predicted[..., MASS] = scenes[..., MASS]
        np.put_along_axis(pressed, order[..., 0], touched, axis=1)
        return predicted, pressed


def takes_disks(bodies: Bodies) -> bool:
    """Return whether the kernels for disks can push these bodies."""
    return bodies.all_round and not bodies.fixed


@lru_cache(maxsize=16)  # a filter remembers pushes, also those of the episode before
def _filter(prior: PlanarPrior, config: FrictionConfig) -> FrictionFilter:
    return FrictionFilter(prior, prior.config.friction, config)


def step_knowing(
    prior: Dynamics, scenes: Scenes, pushes: Pushes, friction: Scalars | None
) -> Scenes:
    """Predict with a prior that is told the friction (B,), if there is any and it can be told."""
    if friction is not None and isinstance(prior, PlanarPrior):
        return prior.step(scenes, pushes, friction)
    if isinstance(prior, (PlanarPrior, IdentityPrior)):
        return prior.step(scenes, pushes)
    with answering("the prior"):
        return check_step(prior.step(scenes, pushes), scenes, "the prior")


def disks_first(scenes: Scenes, pushed: Indices) -> np.ndarray:
    """Return an order of the disks (B, N, 1) in which the pushed one is the first.

    The solver visits contacts one after another, which would let the numbering leak into the
    last digits. Sorting the disks from 2 on by their distance to disk 1 keeps it out.
    """
    order = np.broadcast_to(np.arange(scenes.shape[1]), scenes.shape[:2]).copy()
    np.put_along_axis(order, pushed[:, None], 0, axis=1)
    order[:, MID] = pushed
    if scenes.shape[1] > 3:
        placed = np.take_along_axis(scenes, order[..., None], axis=1)
        offset = placed[:, 2:, POSITION] - placed[:, TARGET : TARGET + 1, POSITION]
        sort = np.argsort((offset**2).sum(-1), axis=1, kind="stable")
        order[:, 2:] = np.take_along_axis(order[:, 2:], sort, axis=1)
    return order[..., None]
