"""Which pushes the arm can carry out from a scene: pure geometry, batched, shared by all.

The planner masks with it before it rolls out, the simulator refuses with it before it moves.
`Reach` is a plain description of where the tool can go; the simulator checks exact inverse
kinematics on top, and a test holds the two together.
"""

from dataclasses import dataclass

import numpy as np

from sain_core.config import Config, option
from sain_core.push import LENGTH, PushLimits, push_direction, tool_start
from sain_core.scene import MID, POSITION, RADIUS, Table, unit
from sain_core.types import Mask, Points, Pushes, Scalars, Scenes


@dataclass(frozen=True)
class Reach(Config):
    """Where a vertical tool can stand: a ring about the arm's base, cut off behind it."""

    inner: float = option(0.20, "smallest distance from the base axis", unit="m", minimum=0.0)
    outer: float = option(0.74, "largest distance from the base axis", unit="m", minimum=0.1)
    max_bearing: float = option(2.2, "largest |bearing| seen from the base", unit="rad")

    def contains(self, points: Points) -> Mask:
        """Tell which tool positions (..., 2) the arm can take."""
        distance = np.hypot(points[..., 0], points[..., 1])
        bearing = np.abs(np.arctan2(points[..., 1], points[..., 0]))
        return np.asarray(
            (distance >= self.inner) & (distance <= self.outer) & (bearing <= self.max_bearing)
        )


def reachable(scenes: Scenes, pushes: Pushes, limits: PushLimits, reach: Reach) -> Mask:
    """Tell for which pushes the tool's whole way lies in reach.

    The ring is not convex: the way is checked where it starts, ends and comes nearest the base.
    """
    start = tool_start(scenes, pushes, limits)
    way = unit(push_direction(pushes))
    length = pushes[..., LENGTH]
    nearest = np.clip(-(start * way).sum(-1), 0.0, length)
    ok = reach.contains(start)
    ok &= reach.contains(start + nearest[..., None] * way)
    ok &= reach.contains(start + length[..., None] * way)
    return np.asarray(ok)


def tool_gap(scenes: Scenes, pushes: Pushes, limits: PushLimits) -> Scalars:
    """Return the smallest gap [m] between the tool on its way and any disk but the mid disk.

    The other disks are taken where they stand before the push. Negative: they would touch.
    """
    start = tool_start(scenes, pushes, limits)
    way = unit(push_direction(pushes))
    offset = scenes[..., MID + 1 :, POSITION] - start[..., None, :]  # (..., N - 1, 2)
    along = np.clip((offset * way[..., None, :]).sum(-1), 0.0, pushes[..., LENGTH, None])
    apart = np.linalg.norm(offset - along[..., None] * way[..., None, :], axis=-1)
    gaps = apart - scenes[..., MID + 1 :, RADIUS] - limits.tool_radius
    return np.asarray(gaps.min(axis=-1))


@dataclass(frozen=True)
class Feasibility(Config):
    """Everything that decides whether a push can be carried out."""

    limits: PushLimits = PushLimits()
    reach: Reach = Reach()
    table: Table = Table()
    tool_margin: float = option(
        0.002,
        "smallest gap between the tool and every other disk",
        unit="m",
        minimum=0.0,
        maximum=0.05,
    )

    def mask(self, scenes: Scenes, pushes: Pushes) -> Mask:
        """Tell which pushes are reachable and unblocked; one of zero length always is."""
        free = tool_gap(scenes, pushes, self.limits) >= self.tool_margin
        possible = free & reachable(scenes, pushes, self.limits, self.reach)
        return np.asarray(possible | (pushes[..., LENGTH] == 0.0))
