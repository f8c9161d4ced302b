"""What the pictures of single pushes and of one object show, as numbers for the file of results."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from benchmarks.real.kept import DEGREE, Outcome
from benchmarks.real.pushes import PushTable, turned
from sain_core.scene import unit, wrap_angle
from sain_core.shapes.library import get_shape
from sain_core.shapes.shape import FLAT_MARK, outline_of
from sain_core.shapes.solids import DISK
from sain_core.types import Points, Scalars

Figures = dict[str, Any]

COLUMNS: Final = 32  # along the outline
ANGLES: Final = 9  # between motion and normal
FAR: Final = 0.01  # [m], that a body moved by in pushes that are drawn
QUANTILES: Final = (0.1, 0.3, 0.5, 0.7, 0.9, 0.97)  # of the error, of the pushes that are drawn


def field(pushes: PushTable, main: Mapping[str, Outcome]) -> Figures:
    """Return the mean of what predictions leave on one object, by contact and by angle.

    The object is the one with the most pushes that is not round. Residuals are what happened less
    what was predicted: along the inward normal of the contact and to its left [mm], and of the
    heading [degrees].
    """
    cornered = pushes.object[~np.isin(pushes.shape, [DISK, DISK + FLAT_MARK])]
    names, counts = np.unique(cornered if len(cornered) else pushes.object, return_counts=True)
    name = str(names[np.argmax(counts)])
    chosen = (pushes.object == name) & pushes.touches
    some = pushes.select(chosen)
    place = np.minimum((COLUMNS * locations(some)).astype(int), COLUMNS - 1)
    angle = wrap_angle(some.heading - some.normal) / np.pi + 0.5  # 0 to 1
    cell = np.clip((ANGLES * angle).astype(int), 0, ANGLES - 1) * COLUMNS + place
    count = np.bincount(cell, minlength=ANGLES * COLUMNS)
    residuals = {}
    for key, one in main.items():
        predicted = one.predicted.poses[np.isin(one.rows, np.flatnonzero(chosen))]
        left = turned(some.after[:, :2] - predicted[:, :2], -some.normal) * 1e3
        spin = wrap_angle(some.after[:, 2] - predicted[:, 2]) / DEGREE
        with np.errstate(invalid="ignore"):
            residuals[key] = [
                np.round(np.bincount(cell, part, len(count)) / count, 3).tolist()
                for part in (*left.T, spin)
            ]
    return {
        "object": name,
        "pushes": len(some),
        "corners": corner_places(str(some.shape[0])),
        "size": [ANGLES, COLUMNS],
        "residuals": residuals,
    }


def locations(pushes: PushTable) -> Scalars:
    """Return where contacts of pushes of one shape lie along its outline, 0 to 1."""
    outline = outline_of(get_shape(str(pushes.shape[0])))
    points = pushes.in_body(pushes.contact - pushes.before[:, :2]) / pushes.radius[:, None]
    here, ways = outline.corners[:-1], np.diff(outline.corners, axis=0)
    apart = points[:, None] - here
    part = np.clip((apart * ways).sum(-1) / (ways**2).sum(-1), 0.0, 1.0)
    side = np.linalg.norm(apart - part[..., None] * ways, axis=-1).argmin(axis=1)
    row = np.arange(len(points)), side
    return np.asarray(outline.shares[side] + part[row] * np.diff(outline.shares)[side])


def corner_places(name: str) -> list[float]:
    """Return where an outline of few corners has them, 0 to 1; of others none is drawn."""
    outline = outline_of(get_shape(name))
    sharp = outline.shares[1:-1] if len(outline.shares) < 12 else outline.shares[:0]
    return [round(float(share), 4) for share in sharp]


def examples(pushes: PushTable, main: Mapping[str, Outcome], judge: str) -> list[Figures]:
    """Return pushes to draw that moved the body, each of another object where there are enough.

    They go from small to large errors of the row `judge`: each is a quantile of its object's.
    """
    names = np.unique(pushes.object)
    chosen = names[np.linspace(0, len(names) - 1, len(QUANTILES)).round().astype(int)]
    one, found = main[judge], []
    moved = np.linalg.norm(pushes.moves[:, :2], axis=1) > FAR
    for name, quantile in zip(chosen, QUANTILES, strict=True):
        here = np.flatnonzero((pushes.object[one.rows] == name) & moved[one.rows])
        if not len(here):
            continue
        place = here[np.argsort(one.mm[here])[int(quantile * (len(here) - 1))]]
        found.append(example(pushes, main, int(one.rows[place]), quantile))
    return found


def example(pushes: PushTable, main: Mapping[str, Outcome], index: int, quantile: float) -> Figures:
    """Return one push in the world: outlines before, after, and as each row predicts it."""
    way = pushes.length[index] * unit(pushes.heading[index])
    start = pushes.start[index]
    predicted = {
        key: one.predicted.poses[np.searchsorted(one.rows, index)] for key, one in main.items()
    }
    outline = pushes.outline(index)
    return {
        "object": str(pushes.object[index]),
        "surface": str(pushes.surface[index]),
        "quantile": quantile,
        "tool": [start.tolist(), (start + way).tolist(), float(pushes.tip[index])],
        "before": _placed(outline, pushes.before[index]).tolist(),
        "after": _placed(outline, pushes.after[index]).tolist(),
        "predicted": {key: _placed(outline, pose).tolist() for key, pose in predicted.items()},
        "mm": {
            key: float(1e3 * np.hypot(*(pose - pushes.after[index])[:2]))
            for key, pose in predicted.items()
        },
    }


def _placed(outline: Points, pose: np.ndarray) -> Points:
    return np.asarray(np.round(pose[:2] + turned(outline, np.full(len(outline), pose[2])), 5))
