"""One shard of transitions: read, checked, and everything about it named that is wrong."""

from pathlib import Path
from typing import Final

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from sain_core.errors import DatasetError
from sain_core.push import PUSH_SIZE
from sain_core.scene import MASS, RADIUS, STATE_SIZE
from sain_core.storage import read_arrays
from sain_core.types import Scenes

STATES: Final = ("state", "physics_next", "next_state")
NEEDED: Final = (*STATES, "action", "episode")
FLOOR: Final = "floor_next"  # the same push once more in a world set to the observed state
FRICTION: Final = "friction"
STEP: Final = "step"  # a push's place in its episode
NO_STEP: Final = -1  # where a shard does not tell


def read_shard(path: Path) -> dict[str, ndarray]:
    """Read and check one shard; states come back as (M, N, 8).

    Raises:
        DatasetError: a damaged shard, a missing key, no rows, arrays that do not fit together,
            NaN or Inf, or a number that cannot be.
    """
    arrays = read_arrays(path)
    missing = [key for key in NEEDED if key not in arrays]
    if missing:
        raise DatasetError(f"{path} lacks {', '.join(missing)}; it holds {sorted(arrays)}")
    if arrays["action"].ndim == 0 or not len(arrays["action"]):
        raise DatasetError(f"{path} holds no transitions")
    count = len(arrays["action"])
    unknown = np.full(count, np.nan)
    shard_arrays = {key: _states(path, key, arrays[key], count) for key in STATES}
    shard_arrays["action"] = _numbers(path, "action", arrays["action"], (count, PUSH_SIZE))
    shard_arrays["episode"] = _integers(path, "episode", arrays["episode"], count)
    shard_arrays[FRICTION] = _friction(path, arrays.get(FRICTION, unknown), count)
    steps = arrays.get(STEP, np.full(count, NO_STEP))
    shard_arrays[STEP] = _integers(path, STEP, steps, count)
    shape = shard_arrays["state"].shape
    repeats = arrays.get(FLOOR, np.full(shape, np.nan))
    if repeats.size != shard_arrays["state"].size:
        raise DatasetError(f"{path}: {FLOOR} has shape {repeats.shape}; it should be as state")
    shard_arrays[FLOOR] = np.asarray(repeats, dtype=np.float64).reshape(shape)
    if (shard_arrays["state"][..., [MASS, RADIUS]] <= 0.0).any():
        raise DatasetError(f"{path}: state has a mass or radius that is not positive")
    return shard_arrays


def _states(path: Path, key: str, values: ndarray, count: int) -> Scenes:
    if values.ndim not in (2, 3) or values.size % (STATE_SIZE * max(count, 1)):
        raise DatasetError(f"{path}: {key} has shape {values.shape}; it should be ({count}, N * 8)")
    disks = values.size // (STATE_SIZE * max(count, 1))
    if disks < 2:
        raise DatasetError(f"{path}: {key} has {disks} disks; it needs 2 or more")
    flat = _numbers(path, key, values.reshape(len(values), -1), (count, disks * STATE_SIZE))
    return flat.reshape(count, disks, STATE_SIZE)


def _numbers(path: Path, key: str, values: ndarray, shape: tuple[int, ...]) -> ndarray:
    if values.shape != shape:
        raise DatasetError(f"{path}: {key} has shape {values.shape}; it should be {shape}")
    numbers = np.asarray(values, dtype=np.float64)
    if not np.isfinite(numbers).all():
        row = int(np.argwhere(~np.isfinite(numbers))[0][0])
        raise DatasetError(f"{path}: row {row} of {key} holds NaN or Inf")
    return numbers


def _integers(path: Path, key: str, values: ndarray, count: int) -> Int[ndarray, "M"]:
    if values.shape != (count,) or values.dtype.kind not in "iu":
        raise DatasetError(f"{path}: {key} is {values.dtype} {values.shape}; integers ({count},)")
    return values.astype(np.int64)


def _friction(path: Path, values: ndarray, count: int) -> ndarray:
    """Return the true friction (M,), NaN where it is not known."""
    if values.shape != (count,):
        raise DatasetError(f"{path}: friction has shape {values.shape}; it should be ({count},)")
    numbers = np.asarray(values, dtype=np.float64)
    wrong = ~np.isnan(numbers) & ~((numbers > 0.0) & np.isfinite(numbers))
    if wrong.any():
        row = int(np.argmax(wrong))
        raise DatasetError(
            f"{path}: row {row} of friction is {numbers[row]}; positive, or NaN where not known"
        )
    return numbers
