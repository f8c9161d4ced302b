"""Real pushes as a data set: scenes of one body, strokes, and what physics predicts.

Pushes that nearly repeat others are one episode: a split that divided them would test what was
learned.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Any, Final

import numpy as np
from jaxtyping import Int
from numpy import ndarray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from sain_core.errors import DatasetError
from sain_core.output import claim_folder, remove, write_json
from sain_core.provenance import provenance
from sain_core.push import make_stroke
from sain_core.scene import MASS, POSITION, RADIUS, STATE_SIZE, THETA, unit, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.outlines import OUTLINES_FILE, write_outlines
from sain_core.shapes.shape import FLAT
from sain_core.storage import write_arrays
from sain_core.transitions import (
    MOVED,
    SHARD_PATTERN,
    SHARD_SIZE,
    Column,
    Columns,
    describe_bodies,
    describe_fields,
    shard_path,
)
from sain_core.types import Pushes, Scenes
from sain_model.importing.files import BodyKey, Recordings
from sain_model.importing.real_pushes import RealPushes
from sain_model.physics.parameters import PlanarConfig
from sain_model.physics.planar import FirstTouch, PlanarPrior, first_touch

NEAR: Final = 0.001  # [m], of the starts and of the lengths of two ways
NEARLY_ALONG: Final = pi / 180  # [rad], of their headings


def repeat_groups(pushes: RealPushes) -> Int[ndarray, "M"]:
    """Return the group of each push, from 0 on.

    Two of one body are in one group if their tools went the same way against it, seen from the
    body, within `NEAR` and `NEARLY_ALONG`; and so on from one to the next. Speed and surface do not
    matter: they change an outcome by less than what a model could remember of it.
    """
    start = pushes.in_body(pushes.tip_start)
    heading = pushes.heading - pushes.before[:, 2]
    groups, count = np.empty(len(pushes), np.int64), 0
    for name in dict.fromkeys(pushes.object.tolist()):
        own = np.flatnonzero(pushes.object == name)
        pairs = cKDTree(start[own]).query_pairs(NEAR, output_type="ndarray")
        first, second = own[pairs].T
        near = np.abs(wrap_angle(heading[first] - heading[second])) < NEARLY_ALONG
        near &= np.abs(pushes.length[first] - pushes.length[second]) < NEAR
        links = coo_matrix((np.ones(near.sum()), pairs[near].T), shape=(len(own), len(own)))
        found, labels = connected_components(links, directed=False)
        groups[own] = labels + count
        count += found
    _, first_seen, numbered = np.unique(groups, return_index=True, return_inverse=True)
    order = np.argsort(np.argsort(first_seen))
    return np.asarray(order[numbered])


CARD_FILE: Final = "card.json"
EXAMPLES: Final = 3
PHYSICS: Final = PlanarConfig()


@dataclass(frozen=True, eq=False)
class Imported:
    """A data set in memory.

    Attributes:
        columns: of all rows.
        bodies: by the name of the shape.
        inside: where the pushes are that were left out: their tool began inside the body.
        misses: how many never touch it.
        groups: of near repeats.
    """

    columns: Columns
    bodies: dict[BodyKey, Bodies]
    inside: tuple[str, ...]
    misses: int
    groups: Int[ndarray, "M"]


def import_pushes(
    found: Recordings,
    mass: float,
    skip_bad: bool,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> Imported:
    """Return recordings as a data set.

    Args:
        found: what was read.
        mass: of bodies whose mass no row states [kg].
        skip_bad: leave out pushes whose tool begins inside the body; else they are an error.
        progress: called with how many rows are predicted, and of how many.

    Raises:
        DatasetError: a push that begins inside the body, unless they are left out; or none is left.
    """
    bodies = {key: Bodies((body.shape.on(FLAT),)) for key, body in found.bodies.items()}
    state, after, strokes = _scenes(found, mass)
    touch = _touches(found, bodies, state, strokes)
    inside = tuple(found.pushes.where(int(row)) for row in np.flatnonzero(touch.inside))
    if inside and not skip_bad:
        row = int(np.argmax(touch.inside))
        raise DatasetError(
            f"{inside[0]}: the tool begins {-1e3 * touch.gap[row]:.1f} mm inside the body; correct"
            " poses, outline or tip_radius, or leave such rows out (--skip-bad)"
        )
    keep = ~touch.inside
    if not keep.any():
        raise DatasetError(
            f"in all {len(keep)} rows the tool begins inside the body: frames or units of poses,"
            " outlines and tool do not fit"
        )
    pushes, keys = found.pushes.select(keep), [found.keys[row] for row in np.flatnonzero(keep)]
    state, after, strokes = state[keep], after[keep], strokes[keep]
    groups = repeat_groups(pushes)
    physics = _predict(bodies, keys, state, strokes, progress)
    columns = _columns(pushes, bodies, keys, state, strokes, physics, after, groups)
    return Imported(columns, bodies, inside, int(np.isinf(touch.distance[keep]).sum()), groups)


def _scenes(found: Recordings, mass: float) -> tuple[Scenes, Scenes, Pushes]:
    """Return scenes (M, 1, 8) before and after, and strokes (M, 8)."""
    pushes = found.pushes
    own = [found.bodies[key] for key in found.keys]
    radius, centre = np.array([body.radius for body in own]), np.array([b.centre for b in own])
    known = np.where(np.isnan(pushes.mass), mass, pushes.mass)
    scenes = []
    for poses in (pushes.before, pushes.after):
        states = np.zeros((len(pushes), 1, STATE_SIZE))
        cos, sin = unit(poses[:, 2]).T
        turned = (cos * centre[:, 0] - sin * centre[:, 1], sin * centre[:, 0] + cos * centre[:, 1])
        states[:, 0, POSITION] = poses[:, :2] + np.column_stack(turned)
        states[:, 0, THETA] = poses[:, 2]
        states[:, 0, MASS], states[:, 0, RADIUS] = known, radius
        scenes.append(states)
    strokes = make_stroke(
        pushes.tip_start,
        pushes.heading,
        pushes.length,
        speed=pushes.speed,
        tip_radius=pushes.tip_radius,
    )
    return scenes[0], scenes[1], strokes


def _rows_of(keys: list[BodyKey]) -> dict[BodyKey, ndarray]:
    """Return the rows of each body."""
    rows: dict[BodyKey, list[int]] = {}
    for row, key in enumerate(keys):
        rows.setdefault(key, []).append(row)
    return {key: np.array(some) for key, some in rows.items()}


def _touches(
    found: Recordings, bodies: dict[BodyKey, Bodies], scenes: Scenes, strokes: Pushes
) -> FirstTouch:
    parts = {
        name: np.zeros(len(strokes), np.int64 if name == "nearest" else np.float64)
        for name in ("gap", "nearest", "distance", "normal")
    }
    for key, rows in _rows_of(found.keys).items():
        touch = first_touch(scenes[rows], strokes[rows], bodies[key])
        for name, values in parts.items():
            values[rows] = getattr(touch, name)
    return FirstTouch(**parts)


def _predict(
    bodies: dict[BodyKey, Bodies],
    keys: list[BodyKey],
    scenes: Scenes,
    strokes: Pushes,
    progress: Callable[[int, int], None],
) -> Scenes:
    predicted, done = np.empty_like(scenes), 0
    for key, rows in _rows_of(keys).items():
        prior = PlanarPrior(PHYSICS, bodies[key])
        for part in np.array_split(rows, -(-len(rows) // SHARD_SIZE)):
            predicted[part] = prior.step(scenes[part], strokes[part])
            done += len(part)
            progress(done, len(keys))
    return predicted


def _columns(
    pushes: RealPushes,
    bodies: dict[BodyKey, Bodies],
    keys: list[BodyKey],
    state: Scenes,
    strokes: Pushes,
    physics: Scenes,
    after: Scenes,
    groups: Int[ndarray, "M"],
) -> Columns:
    named = {key: describe_bodies(some) for key, some in bodies.items()}
    count = len(pushes)
    moved = np.linalg.norm((after - state)[:, 0, POSITION], axis=1)
    return {
        Column.STATE: state.reshape(count, -1),
        Column.ACTION: strokes,
        Column.PHYSICS_NEXT: physics.reshape(count, -1),
        Column.NEXT_STATE: after.reshape(count, -1),
        Column.EPISODE: groups,
        Column.STEP: _places(groups),
        Column.MASSES: state[..., MASS],
        Column.RADII: state[..., RADIUS],
        Column.SHAPES: np.array([named[key][Column.SHAPES] for key in keys]),
        Column.ROLES: np.array([named[key][Column.ROLES] for key in keys]),
        Column.MOVED: moved >= MOVED,
        Column.DURATION: pushes.length / pushes.speed,
        Column.SURFACE: pushes.surface,
        Column.OBJECT: pushes.object,
        Column.RUN: pushes.run,
    }


def _places(groups: Int[ndarray, "M"]) -> Int[ndarray, "M"]:
    """Return the place of each row in its group."""
    order = np.argsort(groups, kind="stable")
    _, first = np.unique(groups[order], return_index=True)
    places = np.empty_like(groups)
    places[order] = np.arange(len(groups)) - np.repeat(first, np.diff([*first, len(groups)]))
    return places


def claim_data_set(folder: Path, overwrite: bool) -> None:
    """Make the folder of a data set, without an earlier one; raises `OutputError`."""
    names = CARD_FILE, OUTLINES_FILE, SHARD_PATTERN
    claim_folder(folder, names, overwrite)
    for path in [path for name in names for path in folder.glob(name)]:
        remove(path)


def write_imported(folder: Path, made: Imported, card: dict[str, Any]) -> int:
    """Write shards, outlines and, last, the card; return the number of shards.

    Raises:
        OutputError: the folder cannot be written.
    """
    write_outlines(folder, [some.shapes[0] for some in made.bodies.values()])
    firsts = range(0, len(made.groups), SHARD_SIZE)
    for index, first in enumerate(firsts):
        rows = slice(first, first + SHARD_SIZE)
        write_arrays(shard_path(folder, index), {str(n): v[rows] for n, v in made.columns.items()})
    write_json(folder / CARD_FILE, {**provenance("sain_model"), **card, **_summary(made)})
    return len(firsts)


def _summary(made: Imported) -> dict[str, Any]:
    columns = made.columns
    sizes = np.bincount(made.groups)
    counts = {
        str(name): dict(
            zip(
                *(part.tolist() for part in np.unique(columns[name], return_counts=True)),
                strict=True,
            )
        )
        for name in (Column.SURFACE, Column.OBJECT, Column.RUN, Column.SHAPES)
    }
    return {
        "transitions": len(made.groups),
        "moved": int(columns[Column.MOVED].sum()),
        "misses": made.misses,
        "left_out": {
            "tool begins inside the body": len(made.inside),
            "rows": made.inside[:EXAMPLES],
        },
        "groups_of_repeats": len(sizes),
        "share_with_repeat": float((sizes[made.groups] > 1).mean()),
        "largest_group": int(sizes.max()),
        "physics_next": "computed: planar with its default settings",
        "counts": counts,
        "shard_size": SHARD_SIZE,
        "fields": describe_fields(columns),
    }
