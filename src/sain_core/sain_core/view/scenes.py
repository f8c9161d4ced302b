"""Lists of things to draw: of the table, of a scene, of a row, of an episode and of a plan."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.feasibility import Feasibility
from sain_core.goal import Goal
from sain_core.push import LENGTH, PushLimits, pushed_bodies, strokes
from sain_core.scene import POSE, POSITION, TARGET, THETA, Table, unit, wrap_angle
from sain_core.shapes.bodies import Bodies, Role
from sain_core.types import PushArray, Pushes, Scene, Scenes
from sain_core.view.palette import body_colours
from sain_core.view.things import (
    BodyPath,
    DrawnBody,
    GoalMark,
    Look,
    PushArrow,
    ReachArea,
    Region,
    TableTop,
    Thing,
)
from sain_core.world import PushRecord

MOVED: Final = 1e-3  # [m], a body that moved less has no path and no predictions
FAR: Final = 0.01  # [m], a body that moved less is not drawn on its way
TURNED: Final = 0.1  # [rad], or turned less, the same for its predictions in an episode
VISIBLY_OFF: Final = (0.003, 0.03)  # [m], [rad]: predictions that were nearer have no outline
LIMITS: Final = PushLimits()
NAMES: Final = ("mid", "target")  # the paper's, of disks 0 and 1


def stage(feasibility: Feasibility = Feasibility()) -> list[Thing]:
    """Return the table and the part of it that the tool reaches."""
    table = table_top(feasibility.table)
    return [table, ReachArea(feasibility.reach.outlines, table)]


def table_top(table: Table) -> TableTop:
    """Return the table."""
    return TableTop(np.array([table.x_min, table.y_min]), np.array([table.x_max, table.y_max]))


def names_of(bodies: Bodies) -> list[str]:
    """Return what bodies are called: the paper's words for its roles, else shape and role."""
    count = len(bodies)
    if bodies.stand_in_for_disks:
        return [*NAMES, *(f"disk {disk}" for disk in range(len(NAMES), count))][:count]
    return [
        f"{body} {shape.name}" + ("" if role is Role.PUSHABLE else f", {role}")
        for body, (shape, role) in enumerate(zip(bodies.shapes, bodies.roles, strict=True))
    ]


def colours_of(bodies: Bodies, goal: Goal | None = None) -> list[str]:
    """Return the names of the colours of bodies: their own if they may be pushed or have a pose."""
    own = {*bodies.pushable, *(goal.wanted if goal else (TARGET,))}
    return body_colours([body in own for body in range(len(bodies))])


def bodies_in(
    scene: Scene,
    bodies: Bodies,
    goal: Goal | None = None,
    look: Look = Look.NOW,
    only: Iterable[int] | None = None,
    share: float = 0.0,
) -> list[DrawnBody]:
    """Return the bodies of a scene (N, 8), or only some of them."""
    bodies = bodies.fitted(len(scene))
    names, colours = names_of(bodies), colours_of(bodies, goal)
    headed = {pose.body for pose in goal.poses if pose.heading is not None} if goal else set()
    drawn = []
    for body in range(len(scene)) if only is None else only:
        what = body, names[body], bodies.shapes[body], scene[body], colours[body], look
        drawn.append(DrawnBody(*what, body in bodies.fixed, body in headed, share))
    return drawn


def goal_marks(goal: Goal | None, scene: Scene, bodies: Bodies) -> list[GoalMark]:
    """Return the poses of a goal that was given in a scene (N, 8)."""
    poses = [pose for pose in (goal.poses if goal else ()) if pose.body < len(scene)]
    if goal is None or len(poses) < len(goal.poses):
        return []  # of another scene
    placed = bodies_in(goal.placed(scene), bodies, goal, only=goal.wanted)
    return [GoalMark(body, pose.tolerance) for body, pose in zip(placed, goal.poses, strict=True)]


def push_arrow(
    scene: Scene, push: PushArray, bodies: Bodies, number: int = 0, limits: PushLimits = LIMITS
) -> list[PushArrow]:
    """Return the arrow of a push from a scene (N, 8); nothing for one that cannot be drawn."""
    if not np.isfinite(push).all() or push[LENGTH] <= 0.0 or pushed_bodies(push) >= len(scene):
        return []
    start, heading = strokes(scene, push, limits, bodies.fitted(len(scene)))
    return [PushArrow(start, start + push[LENGTH] * unit(heading), number)]


def predictions(
    before: Scene | None, after: Scene | None, predicted: Scene | None, bodies: Bodies, look: Look
) -> list[DrawnBody]:
    """Return the bodies (N, 8) as a push was predicted to leave them, if they moved or should."""
    if predicted is None or not np.isfinite(predicted[:, POSE]).all():
        return []
    if len(bodies.fitted(len(predicted))) != len(predicted):
        return []
    first = predicted if before is None or before.shape != predicted.shape else before
    last = predicted if after is None or after.shape != predicted.shape else after
    moved = np.maximum(_ways(first, predicted), _ways(first, last)) > MOVED
    shown = bodies_in(predicted, bodies, look=look, only=np.flatnonzero(moved).tolist())
    colour = "predicted" if look is Look.EXPECTED else "physics"
    return [replace(body, colour=colour) for body in shown]


def episode_things(
    start: Scene,
    rows: Sequence[PushRecord],
    goal: Goal,
    bodies: Bodies,
    limits: PushLimits = LIMITS,
) -> list[Thing]:
    """Return a whole episode: bodies, their paths, the goal, predictions and pushes."""
    scenes = [start, *(row.after for row in rows)]
    things: list[Thing] = []
    for body, name in enumerate(colours_of(bodies, goal)):
        path = np.array([scene[body, POSITION] for scene in scenes])
        steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
        if steps.sum() >= MOVED:
            things.append(BodyPath(body, path, name))
            between = [scene for scene, far in zip(scenes[1:-1], steps > FAR, strict=False) if far]
            for scene in between:
                things += bodies_in(scene, bodies, goal, Look.BETWEEN, (body,))
    things += bodies_in(start, bodies, goal, Look.START)
    things += bodies_in(scenes[-1], bodies, goal)
    things += goal_marks(goal, start, bodies)
    for row in rows:
        things += _misses(row, goal, bodies)
    for number, row in enumerate(rows, start=1):
        things += push_arrow(row.before, row.push, bodies, number, limits)
    return things


def _misses(row: PushRecord, goal: Goal, bodies: Bodies) -> list[Thing]:
    """Return where wanted bodies were expected that moved; in outline where visibly elsewhere."""
    things: list[Thing] = []
    for body in goal.wanted if row.predicted is not None else ():
        assert row.predicted is not None
        straight = bodies.shapes[body].is_round  # a disk's heading shows nowhere
        way, turn = _difference(row.before, row.after, body)
        if way < FAR and (straight or turn < TURNED):
            continue
        ends = np.stack([row.predicted[body, POSITION], row.after[body, POSITION]])
        things.append(BodyPath(body, ends, "predicted", Look.ERROR))
        off = _difference(row.predicted, row.after, body)
        if not straight and (off[0] > VISIBLY_OFF[0] or off[1] > VISIBLY_OFF[1]):
            shown = bodies_in(row.predicted, bodies, look=Look.EXPECTED, only=(body,))
            things += [replace(one, colour="predicted") for one in shown]
    return things


def plan_things(
    scene: Scene,
    bodies: Bodies,
    goal: Goal | None,
    pushes: Pushes,
    predicted: Scenes,
    regions: Float[ndarray, "H N"] | None = None,
    others: Float[ndarray, "R H N 2"] | None = None,
    limits: PushLimits = LIMITS,
) -> list[Thing]:
    """Return a plan (H pushes) from a scene (N, 8), and the scenes (H, N, 8) that it predicts.

    First come other sequences, the cheapest on top; then of the bodies that are wanted, pushed or
    moved: outlines after each push, paths and the regions [m] that should hold them; then the goal
    and the first push.
    """
    ways = np.stack([_ways(scene, one) for one in predicted])
    wanted = [body for body in (goal.wanted if goal else ()) if body < len(scene)]
    moved = np.flatnonzero(ways.max(axis=0) > MOVED).tolist()
    shown = sorted({*wanted, *pushed_bodies(pushes).tolist(), *moved})
    things: list[Thing] = []
    if others is not None and len(others):
        things += _other_paths(scene, others, wanted)
    for step, after in enumerate(predicted, start=1):
        things += bodies_in(after, bodies, goal, Look.PLANNED, shown, step / len(predicted))
    paths = np.concatenate([scene[None], predicted])[..., POSITION]
    colours = colours_of(bodies.fitted(len(scene)), goal)
    things += [BodyPath(body, paths[:, body], colours[body], Look.PLANNED) for body in shown]
    if regions is not None:
        radii = {body: float(regions[0, body]) for body in shown if regions[0, body] > 0.0}
        things += [Region(body, paths[1, body], radius) for body, radius in radii.items()]
    things += goal_marks(goal, scene, bodies)
    return things + push_arrow(scene, pushes[0], bodies, limits=limits)


def _other_paths(
    scene: Scene, others: Float[ndarray, "R H N 2"], wanted: Sequence[int]
) -> list[Thing]:
    first = np.broadcast_to(scene[:, POSITION], (len(others), 1, len(scene), 2))
    places = np.concatenate([first, others], axis=1)
    shares = np.linspace(0.0, 1.0, len(others)).tolist()
    return [
        BodyPath(body, places[number, :, body], "learned", Look.OTHER, shares[number])
        for body in wanted
        for number in reversed(range(len(others)))  # the cheapest over the others
    ]


def extent(things: Iterable[Thing]) -> Float[ndarray, "M 2"]:
    """Return points (M, 2) [m] that hold all bodies, goals, paths and pushes."""
    points = []
    for thing in things:
        if isinstance(thing, DrawnBody | GoalMark):
            body = thing.body if isinstance(thing, GoalMark) else thing
            points += [body.place - body.size, body.place + body.size]
        elif isinstance(thing, PushArrow):
            points += [thing.start, thing.end]
        elif isinstance(thing, BodyPath) and thing.look is not Look.OTHER:
            points += list(thing.points)
    return np.array(points)


def _ways(scene: Scene, other: Scene) -> np.ndarray:
    return np.asarray(np.linalg.norm(scene[:, POSITION] - other[:, POSITION], axis=-1))


def _difference(first: Scene, second: Scene, body: int) -> tuple[float, float]:
    """Return by how much the poses of a body differ in two scenes: distance [m] and turn [rad]."""
    apart = np.linalg.norm(first[body, POSITION] - second[body, POSITION])
    turn = wrap_angle(first[body, THETA] - second[body, THETA])
    return float(apart), abs(float(turn))
