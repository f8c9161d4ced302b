"""Which pushes the arm can carry out from a scene: pure geometry, batched, shared by all.

The planner masks with it before it rolls out, the simulator refuses with it before it moves.
`Reach` is a plain description of where the tool can go; the simulator checks exact inverse
kinematics on top, and a test holds the two together.
"""

from dataclasses import dataclass

import numpy as np

from sain_core.config import Config, option
from sain_core.push import LENGTH, PUSH_SIZE, PushLimits, pushed_bodies, strokes
from sain_core.scene import MID, POSITION, RADIUS, THETA, Table, unit
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.outline import distance_to_way
from sain_core.shapes.shape import Shape
from sain_core.types import Mask, Points, Pushes, Scalars, Scenes, States


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


def reachable(
    scenes: Scenes,
    pushes: Pushes,
    limits: PushLimits,
    reach: Reach,
    bodies: Bodies | None = None,
) -> Mask:
    """Tell for which pushes the tool's whole way lies in reach.

    The ring is not convex: the way is checked where it starts, ends and comes nearest the base.
    """
    start, heading = strokes(scenes, pushes, limits, bodies)
    way, length = unit(heading), pushes[..., LENGTH]
    nearest = np.clip(-(start * way).sum(-1), 0.0, length)
    ok = reach.contains(start)
    ok &= reach.contains(start + nearest[..., None] * way)
    ok &= reach.contains(start + length[..., None] * way)
    return np.asarray(ok)


def tool_gap(
    scenes: Scenes, pushes: Pushes, limits: PushLimits, bodies: Bodies | None = None
) -> Scalars:
    """Return the smallest gap [m] between the tool on its way and any body but the pushed one.

    The other bodies are taken where they stand before the push. Negative: they would touch.
    Infinite: there is no other body.
    """
    start, heading = strokes(scenes, pushes, limits, bodies)
    way = unit(heading)
    if pushes.shape[-1] == PUSH_SIZE and (bodies is None or bodies.all_round):
        others = scenes[..., MID + 1 :, :]
        offset = others[..., POSITION] - start[..., None, :]  # (..., N - 1, 2)
        along = np.clip((offset * way[..., None, :]).sum(-1), 0.0, pushes[..., LENGTH, None])
        apart = np.linalg.norm(offset - along[..., None] * way[..., None, :], axis=-1)
        gaps = apart - others[..., RADIUS] - limits.tool_radius
        return np.asarray(gaps.min(axis=-1, initial=np.inf))
    end = start + pushes[..., LENGTH, None] * way
    pushed, least = pushed_bodies(pushes), np.full(start.shape[:-1], np.inf)
    for body in range(scenes.shape[-2]):
        state = np.broadcast_to(scenes[..., body, :], (*least.shape, scenes.shape[-1]))
        apart = _way_to_body(start, end, state, None if bodies is None else bodies.shapes[body])
        least = np.where(pushed == body, least, np.minimum(least, apart))
    return np.asarray(least - limits.tool_radius)


def start_gap(
    scenes: Scenes, pushes: Pushes, limits: PushLimits, bodies: Bodies | None = None
) -> Scalars:
    """Return the gap [m] between the tool before it travels and the body that it is to push.

    It is the clearance, but near an inner corner of the outline. Negative: they would touch.
    """
    if bodies is None or all(shape.is_convex for shape in bodies.shapes):
        return np.full(pushes.shape[:-1], limits.clearance)
    start, _ = strokes(scenes, pushes, limits, bodies)
    pushed, gap = pushed_bodies(pushes), np.full(start.shape[:-1], limits.clearance)
    for body, shape in enumerate(bodies.shapes):
        mine = np.broadcast_to(pushed == body, gap.shape)
        if not shape.is_convex and mine.any():
            state = np.broadcast_to(scenes[..., body, :], (*gap.shape, scenes.shape[-1]))[mine]
            apart = _way_to_body(start[mine], start[mine], state, shape)
            gap[mine] = apart - limits.tool_radius
    return gap


def _way_to_body(start: Points, end: Points, state: States, shape: Shape | None) -> Scalars:
    """Return the distance [m] from straight ways (..., 2) to a body in states (..., 8)."""
    if shape is None or shape.is_round:
        centre, way = state[..., POSITION], end - start
        size = np.maximum((way * way).sum(-1), 1e-30)
        share = np.clip(((centre - start) * way).sum(-1) / size, 0.0, 1.0)
        apart = np.linalg.norm(centre - start - share[..., None] * way, axis=-1)
        return np.asarray(apart - state[..., RADIUS])
    cos, sin = np.cos(state[..., THETA]), np.sin(state[..., THETA])
    turn = np.stack([np.stack([cos, -sin], -1), np.stack([sin, cos], -1)], -2)
    first, last = (
        ((point - state[..., POSITION])[..., None, :] @ turn)[..., 0, :] for point in (start, end)
    )
    radius = state[..., RADIUS]
    corners = shape.outline(1.0) * radius[..., None, None]
    return distance_to_way(first, last, corners)


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

    def mask(self, scenes: Scenes, pushes: Pushes, bodies: Bodies | None = None) -> Mask:
        """Tell which pushes are reachable and unblocked; one of zero length always is.

        A push must also be against a pushable body, where bodies are given.
        """
        free = tool_gap(scenes, pushes, self.limits, bodies) >= self.tool_margin
        possible = free & reachable(scenes, pushes, self.limits, self.reach, bodies)
        if bodies is not None:
            possible &= start_gap(scenes, pushes, self.limits, bodies) >= 0.0
            possible &= np.isin(pushed_bodies(pushes), bodies.pushable)
        return np.asarray(possible | (pushes[..., LENGTH] == 0.0))
