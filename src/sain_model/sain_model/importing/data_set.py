"""Real pushes as a data set: scenes of one body, strokes, and what physics predicts.

Pushes that nearly repeat others are one episode: a split that divided them would test what was
learned.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import pi
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from jaxtyping import Int
from numpy import ndarray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from sain_core.errors import DatasetError
from sain_core.output import remove, write_json
from sain_core.provenance import provenance
from sain_core.push import SPAN_X, START, make_stroke
from sain_core.scene import (
    MASS,
    OVERLAP_TOLERANCE,
    POSITION,
    RADIUS,
    STATE_SIZE,
    THETA,
    unit,
    wrap_angle,
)
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.outlines import OUTLINES_FILE, write_outlines
from sain_core.shapes.shape import FLAT
from sain_core.storage import write_arrays
from sain_core.transitions import (
    MOVED,
    SHAPED,
    SHARD_PATTERN,
    SHARD_SIZE,
    Column,
    Columns,
    describe_bodies,
    describe_fields,
    shard_path,
)
from sain_core.types import Mask, Pushes, Scalars, Scenes
from sain_model.importing.files import BodyKey, Recordings
from sain_model.importing.real_pushes import IN_DEGREES, RealPushes
from sain_model.inference.evidence import Known
from sain_model.inference.kinds import surface_kind
from sain_model.physics.planar import FirstTouch, PlanarPrior, first_touch

NEAR: Final = 0.001  # [m], of the starts and of the lengths of two ways
NEARLY_ALONG: Final = pi / 180  # [rad], of their headings


def repeat_groups(pushes: RealPushes) -> Int[ndarray, "M"]:
    """Return the group of each push, from 0 on.

    Two of one body are in one group if tools of one form went the same way against it, seen from
    the body, within `NEAR` and `NEARLY_ALONG`; and so on from one to the next. Speed and surface do
    not matter: they change an outcome by less than what a model could remember of it.
    """
    start = pushes.in_body(pushes.tip_start)
    heading, body = pushes.heading - pushes.before[:, 2], pushes.object
    pairs = cKDTree(start).query_pairs(NEAR, output_type="ndarray")
    first, second = pairs.T
    near = np.abs(wrap_angle(heading[first] - heading[second])) < NEARLY_ALONG
    near &= np.abs(pushes.length[first] - pushes.length[second]) < NEAR
    near &= (body[first] == body[second]) & (pushes.bar[first] == pushes.bar[second])
    other = pushes.in_body(pushes.tip_start + pushes.span)
    near &= np.linalg.norm(other[first] - other[second], axis=1) < NEAR
    links = coo_matrix((np.ones(near.sum()), pairs[near].T), shape=(len(pushes), len(pushes)))
    labels = connected_components(links, directed=False)[1]
    _, seen, numbered = np.unique(labels, return_index=True, return_inverse=True)
    return np.asarray(np.argsort(np.argsort(seen))[numbered])


CARD_FILE: Final = "card.json"
WRITTEN: Final = CARD_FILE, OUTLINES_FILE, SHARD_PATTERN
EXAMPLES: Final = 3
FEWER: Final = 3.0  # times as large an error with one unit of headings as with the other
GRAVITY: Final = 9.81  # [m/s^2]
PHYSICS: Final = surface_kind().config  # nominal physics of real bodies, as in `make real`


@dataclass(frozen=True, eq=False)
class Imported:
    """A data set in memory."""

    columns: Columns  # of all rows
    bodies: dict[BodyKey, Bodies]  # by the name of the shape
    # where the pushes are that cannot be, by what is wrong with them
    left_out: dict[str, tuple[str, ...]]
    misses: int  # how many never touch it
    groups: Int[ndarray, "M"]  # of near repeats


def import_pushes(
    found: Recordings,
    mass: float,
    skip_bad: bool,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> Imported:
    """Return recordings as a data set; bodies have this mass [kg] where no row states one.

    `progress` is called with how many rows are predicted, and of how many.

    Raises `DatasetError`: a push that cannot be, unless they are left out (`skip_bad`); most of
    them cannot be, most never touch the body, or headings are in degrees.
    """
    bodies = {key: Bodies((body.shape.on(FLAT),)) for key, body in found.bodies.items()}
    state, after, strokes = _scenes(found, mass)
    touch = _touches(found, bodies, state, strokes)
    misses = np.isinf(touch.distance)
    if misses.sum() > MOST_MISSES * len(misses):
        raise DatasetError(
            f"in {misses.sum():,} of {len(misses):,} pushes the tool never touches the outline,"
            f" first in {found.pushes.where(int(np.argmax(misses)))}; {REMEDY}"
        )
    end = strokes.copy()
    end[:, START] = found.pushes.first_disk(found.pushes.tip_end)
    sunk = -_touches(found, bodies, after, end).gap
    first = strokes.copy()
    first[:, SPAN_X:] = 0.0
    one = _touches(found, bodies, state, first).inside
    faults = faults_of(found.pushes, state, after, touch, sunk, one)
    left_out = _left_out(found.pushes, faults, skip_bad)
    keep = ~np.any([fault.rows for fault in faults], axis=0)
    found, misses = found.select(keep), misses[keep]
    state, after, strokes = state[keep], after[keep], strokes[keep]
    physics, done = np.empty_like(state), 0
    for key, rows in _rows_of(found.keys).items():
        prior = PlanarPrior(PHYSICS, bodies[key])
        for part in np.array_split(rows, -(-len(rows) // SHARD_SIZE)):
            physics[part] = prior.step(state[part], strokes[part])
            done += len(part)
            progress(done, len(state))
    _check_radians(found.pushes, state, after, physics, ~misses)
    groups = repeat_groups(found.pushes)
    named = {key: describe_bodies(some) for key, some in bodies.items()}
    pushes, moved = found.pushes, np.linalg.norm((after - state)[:, 0, POSITION], axis=1)
    columns: Columns = {
        Column.STATE: state.reshape(len(state), -1),
        Column.ACTION: strokes,
        Column.PHYSICS_NEXT: physics.reshape(len(state), -1),
        Column.NEXT_STATE: after.reshape(len(state), -1),
        Column.EPISODE: groups,
        Column.STEP: Known.earlier(groups, np.arange(len(groups))).counts,
        Column.MASSES: state[..., MASS],
        Column.RADII: state[..., RADIUS],
        **{name: np.array([named[key][name] for key in found.keys]) for name in SHAPED},
        Column.MOVED: moved >= MOVED,
        Column.DURATION: pushes.length / pushes.speed,
        Column.SURFACE: pushes.surface,
        Column.OBJECT: pushes.object,
        Column.RUN: pushes.run,
    }
    return Imported(columns, bodies, left_out, int(misses.sum()), groups)


REMEDY: Final = (
    "do frames and units of poses, outlines and tip_radius fit? Outlines may be mirrored, in"
    " millimetres, or about another origin"
)
UNTOUCHED: Final = 0.005  # [m], which measured poses of a body at rest are not apart
UNTURNED: Final = 0.1  # [rad], likewise
MOST_TOOL_TURN: Final = 0.002  # [m], of the difference of two fingers' ways
FASTER: Final = 2.0  # than the tool no place of a pushed body is
SMOOTH: Final = 0.1  # friction with a smooth table, on which a body slides on after a fast push
SINKS: Final = 0.3  # [radii], of the tool's axis into an outline that is roughly right
LEVER: Final = 0.3  # [radii], from where a body turns about to the tool, at least
MOST_BAD: Final = 0.5  # of the rows
MANY_MISSES: Final = 0.25  # of the rows, likewise, that are worth a warning
MOST_MISSES: Final = 0.8


class Fault(NamedTuple):
    """What is wrong with some pushes (M,), and by how much."""

    what: str
    rows: Mask
    detail: Callable[[int], str]


def faults_of(
    pushes: RealPushes, state: Scenes, after: Scenes, touch: FirstTouch, sunk: Scalars, first: Mask
) -> list[Fault]:
    """Return what cannot be in pushes.

    `sunk` is how deep tools end in bodies (M,) [m], `first` which first disks begin in them (M,).
    """
    moved = np.linalg.norm((after - state)[:, 0, POSITION], axis=1)
    turned = np.abs(wrap_angle(after[:, 0, THETA] - state[:, 0, THETA]))
    pushed = np.clip(pushes.length - touch.distance, 0.0, None)
    most = FASTER * pushed + UNTOUCHED + pushes.speed**2 / (2.0 * SMOOTH * GRAVITY)
    most_turn = most / (LEVER * state[:, 0, RADIUS]) + UNTURNED
    still = (moved <= UNTOUCHED) & (turned <= UNTURNED)

    def begins(row: int) -> str:
        what = "bar" if pushes.bar[row] else "tool"
        if pushes.span[row].any() and not (pushes.bar[row] or first[row]):
            what = "second finger"
        return (
            f"the {what} begins {-1e3 * touch.gap[row]:.1f} mm inside the body;"
            f" allowed: up to {1e3 * OVERLAP_TOLERANCE:g} mm"
        )

    def motion(row: int) -> str:
        return (
            f"the body moves by {1e3 * moved[row]:.0f} mm and {np.degrees(turned[row]):.0f} degrees"
        )

    def under(row: int) -> str:
        return f"{motion(row)} under {1e3 * pushed[row]:.0f} mm of a stroke in contact with it"

    return [
        Fault(
            "the tool begins inside the body",
            touch.inside,
            begins,
        ),
        Fault(
            "the tool turns",
            pushes.turn > MOST_TOOL_TURN,
            lambda row: (
                f"the second finger's way differs by {1e3 * pushes.turn[row]:.1f} mm from the"
                f" first one's: the tool turns; allowed: up to {1e3 * MOST_TOOL_TURN:g} mm"
            ),
        ),
        Fault(
            "the body moves, and the tool never touches it",
            np.isinf(touch.distance) & ~still,
            lambda row: f"{motion(row)}, and the tool never touches it",
        ),
        Fault(
            "the tool ends inside the body",
            sunk > pushes.tip_radius + SINKS * state[:, 0, RADIUS],
            lambda row: f"the tool ends {1e3 * sunk[row]:.1f} mm inside the body",
        ),
        Fault("the body moves farther than the tool", moved > most, under),
        Fault("the body turns farther than the tool can turn it", turned > most_turn, under),
    ]


def _left_out(
    pushes: RealPushes, faults: Sequence[Fault], skip_bad: bool
) -> dict[str, tuple[str, ...]]:
    """Return where pushes are that cannot be, each by the first that is wrong with it."""
    left_out: dict[str, tuple[str, ...]] = {}
    seen, firsts = np.zeros(len(pushes), dtype=bool), list[tuple[int, str]]()
    for fault in faults:
        rows = np.flatnonzero(fault.rows & ~seen).tolist()
        seen |= fault.rows
        if rows:
            left_out[fault.what] = tuple(map(pushes.where, rows))
            firsts.append((rows[0], f"{pushes.where(rows[0])}: {fault.detail(rows[0])}"))
    if firsts and not skip_bad:
        raise DatasetError(
            f"{min(firsts)[1]}; correct poses, outline or tip_radius, or leave such rows out"
            " (--skip-bad)"
        )
    if seen.sum() > MOST_BAD * len(seen):
        examples = "; ".join(text for _, text in sorted(firsts))
        raise DatasetError(
            f"{seen.sum():,} of {len(seen):,} pushes cannot be: {examples}; {REMEDY}"
        )
    return left_out


def _check_radians(
    pushes: RealPushes, state: Scenes, after: Scenes, physics: Scenes, touching: Mask
) -> None:
    """Check that bodies do not turn as if their headings, up to 2 pi, were in degrees.

    Physics errs by some degrees. Headings that are in degrees, it misses by most of a turn, and
    much less as soon as they are taken for degrees. Decided for each file by the median.
    """
    turn = after[:, 0, THETA] - state[:, 0, THETA]
    expected = wrap_angle(physics[:, 0, THETA] - state[:, 0, THETA])
    wrong = np.abs(wrap_angle(wrap_angle(turn) - expected))
    as_degrees = np.abs(np.radians(turn) - expected)
    for file, name in enumerate(pushes.files):
        rows = np.flatnonzero(touching & (pushes.file == file))
        if not len(rows):
            continue
        off, less = np.median(wrong[rows]), np.median(as_degrees[rows])
        if off > UNTURNED and less < off / FEWER:
            row = rows[int(np.argmax(wrong[rows]))]
            raise DatasetError(
                f"{name}: headings look like degrees. In row {pushes.row[row]} the body would turn"
                f" by {np.degrees(wrap_angle(turn[row])):.0f} degrees; give radians, or"
                f" {IN_DEGREES}"
            )


def _scenes(found: Recordings, mass: float) -> tuple[Scenes, Scenes, Pushes]:
    """Return scenes (M, 1, 8) before and after, and strokes (M, 11)."""
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
        pushes.first_disk(pushes.tip_start),
        pushes.heading,
        pushes.length,
        speed=pushes.speed,
        tip_radius=pushes.tip_radius,
        span=pushes.axes,
        bar=pushes.bar,
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
    rows = _rows_of(found.keys)
    each = [first_touch(scenes[some], strokes[some], bodies[key]) for key, some in rows.items()]
    order = np.argsort(np.concatenate([*rows.values()]))
    columns = zip(*(vars(touch).values() for touch in each), strict=True)
    return FirstTouch(*(np.concatenate(column)[order] for column in columns))


def write_imported(folder: Path, made: Imported, card: dict[str, Any]) -> int:
    """Replace a data set: shards, outlines and, last, the card; return the number of shards.

    Raises `OutputError`: the folder cannot be written.
    """
    for path in [path for name in WRITTEN for path in folder.glob(name)]:
        remove(path)
    write_outlines(folder, [some.shapes[0] for some in made.bodies.values()])
    firsts = range(0, len(made.groups), SHARD_SIZE)
    for index, first in enumerate(firsts):
        rows = slice(first, first + SHARD_SIZE)
        write_arrays(shard_path(folder, index), {str(n): v[rows] for n, v in made.columns.items()})
    write_json(folder / CARD_FILE, {**provenance(), **card, **summary_of(made)})
    return len(firsts)


def summary_of(made: Imported) -> dict[str, Any]:
    """Return numbers of pushes, as the card has them."""
    columns = made.columns
    sizes = np.bincount(made.groups)
    counts = {
        str(name): dict(sorted(Counter(columns[name].tolist()).items()))
        for name in (Column.SURFACE, Column.OBJECT, Column.RUN, Column.SHAPES)
    }
    return {
        "transitions": len(made.groups),
        "moved": int(columns[Column.MOVED].sum()),
        "misses": made.misses,
        "left_out": {
            what: {"pushes": len(rows), "rows": rows[:EXAMPLES]}
            for what, rows in made.left_out.items()
        },
        "groups_of_repeats": len(sizes),
        "share_with_repeat": float((sizes[made.groups] > 1).mean()),
        "largest_group": int(sizes.max()),
        "physics_next": "computed: planar with the values of a textbook",
        "counts": counts,
        "shard_size": SHARD_SIZE,
        "fields": describe_fields(columns),
    }
