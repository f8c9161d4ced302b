"""The one-push form in which Zhou et al. published real pushes: an ``.npz`` of many of their logs.

Its columns are `COLUMNS`, in m, rad and m/s. The logs themselves are in `importing.mat_logs`.
"""

from pathlib import Path
from typing import Final

import numpy as np
from numpy import ndarray

from sain_core.errors import DatasetError
from sain_core.storage import read_arrays
from sain_model.importing.real_pushes import RealPushes

COLUMNS: Final = {  # of the npz: numbers of a row; none: text
    "surface": None,
    "shape": None,
    "speed": 0,
    "init_pose": 3,
    "final_pose": 3,
    "tip_init": 2,
    "tip_final": 2,
}
TIP_RADIUS: Final = 0.00475  # [m], of that laboratory's tool, which no file states
MOST_PUSHES: Final = 1_000_000


def is_one_push(path: Path) -> bool:
    """Return whether an npz is of this form; raises `DatasetError` where it is damaged."""
    return set(COLUMNS) <= set(read_arrays(path))


def read_npz(path: Path) -> RealPushes:
    """Return the pushes of an npz.

    Raises:
        DatasetError: it is damaged, or of another form.
    """
    arrays = read_arrays(path)
    if missing := [name for name in COLUMNS if name not in arrays]:
        raise DatasetError(f"{path} is of another form: it lacks {', '.join(missing)}")
    count = len(arrays["speed"]) if arrays["speed"].ndim else 0
    if not 0 < count <= MOST_PUSHES:
        raise DatasetError(f"{path} has {count} pushes; allowed: 1 to {MOST_PUSHES:,}")
    for name, size in COLUMNS.items():
        shape = (count, size) if size else (count,)
        kinds, wanted = ("U", "text") if size is None else ("fiu", "real numbers")
        found = arrays[name]
        if found.shape != shape or found.dtype.kind not in kinds:
            raise DatasetError(
                f"{path}: {name} is {found.dtype} of shape {found.shape}; it should be {wanted} of"
                f" shape {shape}"
            )
    poses = [arrays[name].astype(np.float64) for name in list(COLUMNS)[2:]]
    return published_pushes(path, arrays["surface"], arrays["shape"], *poses)


def published_pushes(
    path: Path, surface: ndarray, body: ndarray, speed: ndarray, *poses: ndarray
) -> RealPushes:
    """Return pushes of a published file; poses are before and after, then the tool's ends."""
    count = len(speed)
    unknown = np.full(count, np.nan)
    runs = (
        f"{ground}_{name}_v{1e3 * fast:g}"
        for ground, name, fast in zip(surface.tolist(), body.tolist(), speed.tolist(), strict=True)
    )
    before, after, tip_start, tip_end = poses
    return RealPushes(
        surface,
        body,
        np.array(list(runs)),
        before,
        after,
        tip_start,
        tip_end,
        speed,
        unknown.copy(),
        unknown,
        unknown,
        np.zeros(count, np.int64),
        np.arange(count) + 1,
        (str(path),),
    )
