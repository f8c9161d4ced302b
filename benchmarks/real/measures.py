"""What predictions of real pushes are worth: errors, noise, regions, for one file of JSON."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from benchmarks.real.folds import Case
from benchmarks.real.kept import DEGREE, Kept, Outcome, outcome, pose_errors, rows_of
from benchmarks.real.pushes import PushTable
from benchmarks.real.rows import Row
from sain_core.randomness import bootstrap_mean, generator
from sain_core.scene import unit

Figures = dict[str, Any]

NEAR: Final = 0.5e-3  # [m], between the starts and between the ends of what counts as repeats


def measure(
    pushes: PushTable, cases: Sequence[Case], rows: Sequence[Row], kept: Kept, seed: int
) -> Figures:
    """Return all figures of the page, apart from where they come from."""
    found = {
        case.key: {row.key: outcome(pushes, case, row, kept) for row in rows_of(case, rows)}
        for case in cases
    }
    main = found[cases[0].key]
    return {
        "rows": {row.key: row.title for row in rows},
        "data": describe(pushes),
        "noise": noise(pushes, main, seed),
        "cases": {
            case.key: {
                "title": case.title,
                "pushes": sum(len(fold.test) for fold in case.folds),
                "errors": {
                    key: errors_of(one, pushes, seed, case.key)
                    for key, one in found[case.key].items()
                },
                "regions": {
                    key: regions_of(one, pushes)
                    for key, one in found[case.key].items()
                    if one.predicted.radius is not None
                },
            }
            for case in cases
        },
        "seconds": {
            key: sum(one[key].seconds for one in found.values() if key in one) for key in main
        },
    }


def describe(pushes: PushTable) -> Figures:
    """Return what the data are."""
    names, counts = np.unique(pushes.body, return_counts=True)
    return {
        "pushes": len(pushes),
        "sha256": pushes.data.sha256,
        "bodies": dict(zip(names.tolist(), counts.tolist(), strict=True)),
        "objects": np.unique(pushes.object).tolist(),
        "surfaces": np.unique(pushes.surface).tolist(),
        "speeds": np.unique(pushes.speed.round(4)).tolist(),
        "groups": len(np.unique(pushes.group)),
        "missed": int((~pushes.touches).sum()),
    }


def errors_of(one: Outcome, pushes: PushTable, seed: int, case: str) -> Figures:
    """Return mean errors with 95 % intervals over groups of repeats, and quantiles."""
    groups = pushes.group[one.rows]
    random = generator(seed, "bootstrap", case)  # the same draws for all rows of a table
    return {
        "mm": list(bootstrap_mean(one.mm, random, groups)),
        "degrees": list(bootstrap_mean(one.degrees, random, groups)),
        "median_mm": float(np.median(one.mm)),
        "p90_mm": float(np.quantile(one.mm, 0.9)),
    }


# --- what no model can predict -------------------------------------------------------------------


def repeats(pushes: PushTable) -> Int[ndarray, "P 2"]:
    """Return the pairs of pushes of one body whose tools went the same way, within `NEAR`."""
    order = np.lexsort((pushes.body, pushes.group))
    first, second = order[:-1], order[1:]
    same = pushes.group[first] == pushes.group[second]
    same &= pushes.body[first] == pushes.body[second]
    start = pushes.in_body(pushes.start - pushes.before[:, :2])
    end = start + pushes.length[:, None] * pushes.in_body(unit(pushes.heading))
    for points in (start, end):
        same &= np.linalg.norm(points[first] - points[second], axis=1) <= NEAR
    return np.column_stack([first[same], second[same]])


def noise(pushes: PushTable, main: Mapping[str, Outcome], seed: int) -> Figures:
    """Return how far repeats are apart, and the share of it in the errors of each row.

    Two repeats with independent noise differ by sqrt(2) times as much as one differs from their
    mean: that much even a perfect model errs. Of squared errors, noise is half of a squared
    difference.
    """
    pairs = repeats(pushes)
    if not len(pairs):
        return {"pairs": 0}
    first, second = pushes.select(pairs[:, 0]), pushes.select(pairs[:, 1])
    apart = pose_errors(first.moves, second.moves)
    random = generator(seed, "noise")
    found: Figures = {"pairs": len(pairs)}
    for name, values in zip(("mm", "degrees"), apart, strict=True):
        found[name] = list(bootstrap_mean(values / np.sqrt(2.0), random, first.group))
    rows = np.unique(pairs)
    found["share"] = {
        key: [
            float(0.5 * (values**2).mean() / (error[np.isin(one.rows, rows)] ** 2).mean())
            for values, error in zip(apart, (one.mm, one.degrees), strict=True)
        ]
        for key, one in main.items()
    }
    return found


def regions_of(one: Outcome, pushes: PushTable) -> Figures:
    """Return how often regions hold what happened, in all and for each object."""
    radius, turn = one.predicted.radius, one.predicted.turn
    assert radius is not None and turn is not None
    sizes = {"mm": 1e3 * radius, "degrees": turn / DEGREE}
    errors = {"mm": one.mm, "degrees": one.degrees}
    held = {name: errors[name] <= size for name, size in sizes.items()}
    objects = pushes.object[one.rows]
    return {
        name: {
            "held": float(some.mean()),
            "size": float(sizes[name].mean()),
            "by_object": {
                str(body): float(some[objects == body].mean()) for body in np.unique(objects)
            },
        }
        for name, some in held.items()
    }
