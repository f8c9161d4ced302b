"""The planar prior of one laboratory, where centres of mass lie off the middles of bodies."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from sain_core.errors import ConfigError
from sain_core.push import LENGTH, pushed_bodies
from sain_core.scene import POSITION, RADIUS, THETA
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scalars, Scenes
from sain_model.compute.batch_checks import check_batch
from sain_model.physics.body_table import (
    BodyTable,
    Touched,
    body_table,
    load_shares,
    push_bodies,
    tool_ways,
)
from sain_model.physics.corrections import Corrections
from sain_model.physics.planar import PlanarPrior


@dataclass(frozen=True)
class LabPrior(PlanarPrior):
    """A `PlanarPrior` whose bodies have their centres of mass off the middle.

    Attributes:
        centre: of mass in each body's frame, in units of its radius; equal for all bodies.
    """

    centre: tuple[float, float] = (0.0, 0.0)

    def step_with_contacts(
        self, scenes: Scenes, pushes: Pushes, friction: Scalars | None = None
    ) -> tuple[Scenes, Touched]:
        """Predict as `PlanarPrior` does: bodies move about their centres of mass."""
        bodies = self._bodies(scenes)
        check_batch(scenes, pushes, friction, bodies)
        if friction is None:
            friction = np.full(len(scenes), self.config.friction)
        ways, pushed = tool_ways(scenes, pushes, self._limits, bodies), pushed_bodies(pushes)
        moved, table = self._shifted(scenes, 1.0), shifted_table(bodies, self.centre)
        moved, touched = push_bodies(moved, ways, pushed, friction, table, self._physics)
        after = self._shifted(moved, -1.0)
        idle = pushes[:, LENGTH] == 0.0
        after[idle] = scenes[idle]
        return after, touched

    def step_conditioned(
        self,
        scenes: Scenes,
        pushes: Pushes,
        corrections: Corrections,
        friction: Scalars | None = None,
    ) -> Scenes:
        """Refuse: its centre of mass is given.

        Raises:
            ConfigError: always.
        """
        raise ConfigError("the prior of a laboratory cannot be corrected; take a planar prior")

    def _shifted(self, scenes: Scenes, way: float) -> Scenes:
        """Return scenes whose places are those of the centres of mass, or back again."""
        x, y = self.centre
        cos, sin = np.cos(scenes[..., THETA]), np.sin(scenes[..., THETA])
        offset = np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
        shifted = scenes.copy()
        shifted[..., POSITION] += way * scenes[..., RADIUS, None] * offset
        return shifted


@cache
def shifted_table(bodies: Bodies, centre: tuple[float, float]) -> BodyTable:
    """Return the table of bodies about their centres of mass, which carry the load there, too."""
    table, offset = body_table(bodies), np.array(centre)
    supports = [
        load_shares(table.supports[first:end, :2] - offset)
        for first, end in zip(table.first_support, table.first_support[1:], strict=False)
    ]
    return table._replace(
        corners=np.ascontiguousarray(table.corners - offset),
        supports=np.ascontiguousarray(np.concatenate(supports)),
        reach=table.reach + float(np.hypot(*centre)),
    )
