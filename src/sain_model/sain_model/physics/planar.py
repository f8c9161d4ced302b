"""The planar prior: a batched contact simulator of bodies on a table, without an arm.

It is the fast f_p of the paper's equation 2 that can sit inside every rollout. It believes the
mass and radius that the scene states and, unless told better, the nominal friction.
"""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Final, Self

import numpy as np

from sain_core.history import PushHistory
from sain_core.model import IdentityPrior, Model, answering, check_step
from sain_core.push import LENGTH, PushLimits, pushed_bodies
from sain_core.scene import MASS, MID, RADIUS
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Pushes, Scalars, Scenes
from sain_model.compute.batch_checks import check_batch
from sain_model.compute.kernel_progress import compile_visibly
from sain_model.physics.body_kernels import Physics
from sain_model.physics.body_table import Touched, Ways, body_table, push_bodies, tool_ways
from sain_model.physics.corrections import Corrections, check_corrections
from sain_model.physics.friction import FrictionConfig, FrictionFilter
from sain_model.physics.planar_config import PlanarConfig, with_mass_ratio

NOMINAL_MASS: Final = 8.0  # [kg], the paper, section III-A
NOMINAL_MID_RADIUS: Final = 0.08  # [m]
NOMINAL_RADIUS: Final = 0.06  # [m], of every other disk


@dataclass(frozen=True)
class PlanarPrior(Model):
    """Predicts pushes by simulating them in the plane."""

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
        return self if bodies == self.bodies else replace(self, bodies=bodies)

    def condition(self, history: PushHistory) -> Self:
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
        ways = tool_ways(scenes, pushes, self._limits, self._bodies(scenes), corrections)
        return self._simulate(scenes, ways, pushes, friction, corrections)[0]

    def step_with_contacts(
        self, scenes: Scenes, pushes: Pushes, friction: Scalars | None = None
    ) -> tuple[Scenes, Touched]:
        """As `step`, and tell for each push which bodies the tool touched, (B, N)."""
        check_batch(scenes, pushes, friction, self.bodies)
        ways = tool_ways(scenes, pushes, self._limits, self._bodies(scenes))
        return self._simulate(scenes, ways, pushes, friction)

    def step_as_nominal(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        """Predict as `step`, believing that every body has nominal mass, every disk nominal radius.

        The tool moves as it does in truth: its way comes from the scene's own radii. Overlaps of
        disks that are believed too large are undone without giving them speed.
        """
        check_batch(scenes, pushes, None, self.bodies)
        believed = scenes.copy()
        believed[..., MASS] = NOMINAL_MASS
        if self.bodies.all_round:
            believed[..., RADIUS] = NOMINAL_RADIUS
            believed[:, MID, RADIUS] = NOMINAL_MID_RADIUS
        ways = tool_ways(scenes, pushes, self._limits, self._bodies(scenes))
        predicted, _ = self._simulate(believed, ways, pushes, None)
        predicted[..., MASS:] = scenes[..., MASS:]
        return predicted

    @property
    def _limits(self) -> PushLimits:
        config = self.config
        return PushLimits(tool_radius=config.tool_radius, clearance=config.clearance)

    def _bodies(self, scenes: Scenes) -> Bodies:
        return self.bodies.fitted(scenes.shape[1])

    def _simulate(
        self,
        scenes: Scenes,
        ways: Ways,
        pushes: Pushes,
        friction: Scalars | None,
        corrections: Corrections | None = None,
    ) -> tuple[Scenes, Touched]:
        """Run the kernels."""
        if friction is None:
            friction = np.full(len(scenes), self.config.friction)
        weighed = with_mass_ratio(scenes, self.config.mass_ratio)
        config, pushed = self.config, pushed_bodies(pushes)
        table = body_table(self._bodies(scenes), config.bottom, config.pressure)
        after, touched = push_bodies(
            weighed, ways, pushed, friction, table, self._physics, corrections
        )
        idle = pushes[:, LENGTH] == 0.0
        after[idle] = scenes[idle]
        after[..., MASS] = scenes[..., MASS]
        return after, touched


@lru_cache(maxsize=16)  # a filter remembers pushes, also those of the episode before
def _filter(prior: PlanarPrior, config: FrictionConfig) -> FrictionFilter:
    return FrictionFilter(prior, prior.config.friction, config)


def step_knowing(prior: Model, scenes: Scenes, pushes: Pushes, friction: Scalars | None) -> Scenes:
    """Predict with a prior that is told the friction (B,), if there is any and it can be told."""
    if friction is not None and isinstance(prior, PlanarPrior):
        return prior.step(scenes, pushes, friction)
    if isinstance(prior, (PlanarPrior, IdentityPrior)):
        return prior.step(scenes, pushes)
    with answering("the prior"):
        return check_step(prior.step(scenes, pushes), scenes, "the prior")
