"""Transitions (s, a, f_p(s, a), s') from disk, and their split by episode."""

import hashlib
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from sain_core.errors import DatasetError
from sain_core.push import PUSH_SIZE, mirror_pushes
from sain_core.scene import MASS, RADIUS, STATE_SIZE, mirror_scenes
from sain_core.seeding import generator
from sain_core.types import Mask, Pushes, Scalars, Scenes

STATES: Final = ("state", "physics_next", "next_state")
NEEDED: Final = (*STATES, "action", "episode")
FLOOR: Final = "floor_next"  # the same push once more in a world set to the observed state
FRICTION: Final = "friction"
STEP: Final = "step"  # a push's place in its episode
NO_STEP: Final = -1  # where a shard does not tell


@dataclass(frozen=True)
class Transitions:
    """M pushes with what physics predicted and what happened.

    Attributes:
        scenes: before the push.
        pushes: the pushes.
        physics_next: the nominal world's prediction, the paper's f_p.
        next_scenes: after the push.
        episodes: which episode each belongs to.
        steps: its place in the episode: the order of the data where no ``step`` is given.
        friction: the true friction with the table; NaN where it is not known.
        floor_next: the same push repeated in a world set to the observed state; NaN likewise.
        sha256: of all arrays that are needed.
    """

    scenes: Scenes
    pushes: Pushes
    physics_next: Scenes
    next_scenes: Scenes
    episodes: Int[ndarray, "M"]
    steps: Int[ndarray, "M"]
    friction: Scalars
    floor_next: Scenes
    sha256: str

    def __len__(self) -> int:
        """Return the number of pushes M."""
        return len(self.pushes)

    def select(self, rows: Mask) -> Self:
        """Return the pushes that a mask (M,) picks."""
        return type(self)(
            self.scenes[rows],
            self.pushes[rows],
            self.physics_next[rows],
            self.next_scenes[rows],
            self.episodes[rows],
            self.steps[rows],
            self.friction[rows],
            self.floor_next[rows],
            self.sha256,
        )

    def mirrored(self) -> Self:
        """Return what would have happened in a mirror: the same physics."""
        return type(self)(
            mirror_scenes(self.scenes),
            mirror_pushes(self.pushes),
            mirror_scenes(self.physics_next),
            mirror_scenes(self.next_scenes),
            self.episodes,
            self.steps,
            self.friction,
            mirror_scenes(self.floor_next),
            self.sha256,
        )


@dataclass(frozen=True)
class Split:
    """Three sets of transitions without a common episode."""

    train: Transitions
    validation: Transitions
    test: Transitions


def load_transitions(path: Path) -> Transitions:
    """Read a shard, or all shards ``*.npz`` of a folder in the order of their names.

    Raises:
        DatasetError: nothing there, a damaged shard, a missing key, arrays that do not fit
            together, NaN or Inf, or shards with different numbers of disks.
    """
    shards = sorted(path.glob("*.npz")) if path.is_dir() else [path]
    if not shards:
        raise DatasetError(f"{path} holds no shards *.npz")
    parts = [_read_shard(shard) for shard in shards]
    counts = {shard.name: part["state"].shape[1] for shard, part in zip(shards, parts, strict=True)}
    if len(set(counts.values())) > 1:
        raise DatasetError(f"{path} mixes numbers of disks: {counts}; use one folder for each")
    arrays = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    digest = hashlib.sha256()
    for key in NEEDED:
        digest.update(np.ascontiguousarray(arrays[key]).tobytes())
    return Transitions(
        arrays["state"],
        arrays["action"],
        arrays["physics_next"],
        arrays["next_state"],
        arrays["episode"],
        _steps(path, arrays["episode"], arrays[STEP]),
        arrays[FRICTION],
        arrays[FLOOR],
        digest.hexdigest(),
    )


def split_by_episode(data: Transitions, seed: int, validation: float, test: float) -> Split:
    """Split transitions so that no episode is in two parts.

    Args:
        data: at least three episodes.
        seed: decides which episodes go where.
        validation: share of the episodes to choose the best epoch by.
        test: share of the episodes held out for the card.

    Raises:
        DatasetError: too few episodes for three parts.
    """
    episodes = np.unique(data.episodes)
    held = [max(round(share * len(episodes)), 1) for share in (validation, test)]
    if len(episodes) <= sum(held):
        raise DatasetError(f"{len(episodes)} episodes are too few to train, validate and test")
    shuffled = generator(seed, "split").permutation(episodes)
    test_part, validation_part = shuffled[: held[1]], shuffled[held[1] : sum(held)]
    in_test = np.isin(data.episodes, test_part)
    in_validation = np.isin(data.episodes, validation_part)
    return Split(
        data.select(~(in_test | in_validation)), data.select(in_validation), data.select(in_test)
    )


def limit_training(split: Split, transitions: int) -> Split:
    """Return a split with so many transitions to train on, and as small a share to validate on.

    Episodes are taken in order, the last one in part; what is held out stays whole.

    Raises:
        DatasetError: there are not that many.
    """
    count = len(split.train)
    if transitions > count:
        raise DatasetError(
            f"{transitions} transitions to train on are asked for; there are {count}"
        )
    validated = max(round(len(split.validation) * transitions / count), 1)
    return Split(
        split.train.select(np.arange(count) < transitions),
        split.validation.select(np.arange(len(split.validation)) < validated),
        split.test,
    )


def _read_shard(path: Path) -> dict[str, ndarray]:
    """Read and check one shard; states come back as (M, N, 8)."""
    try:
        with np.load(path, allow_pickle=False) as shard:
            arrays = {key: shard[key] for key in shard.files}
    except FileNotFoundError:
        raise DatasetError(f"{path} does not exist") from None
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise DatasetError(f"{path} is not a whole .npz file: {error}") from error
    missing = [key for key in NEEDED if key not in arrays]
    if missing:
        raise DatasetError(f"{path} lacks {', '.join(missing)}; it holds {sorted(arrays)}")
    count = len(arrays["action"])
    unknown = np.full(count, np.nan)
    shard_arrays = {key: _states(path, key, arrays[key], count) for key in STATES}
    shard_arrays["action"] = _numbers(path, "action", arrays["action"], (count, PUSH_SIZE))
    shard_arrays["episode"] = _integers(path, "episode", arrays["episode"], count)
    shard_arrays[FRICTION] = np.asarray(arrays.get(FRICTION, unknown), dtype=np.float64)
    steps = arrays.get(STEP, np.full(count, NO_STEP))
    shard_arrays[STEP] = _integers(path, STEP, steps, count)
    if shard_arrays[FRICTION].shape != (count,):
        shape = shard_arrays[FRICTION].shape
        raise DatasetError(f"{path}: friction has shape {shape}; it should be ({count},)")
    shape = shard_arrays["state"].shape
    repeats = arrays.get(FLOOR, np.full(shape, np.nan))
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


def _steps(path: Path, episodes: ndarray, steps: ndarray) -> Int[ndarray, "M"]:
    """Return the place of each push in its episode; by the order of the data where none tells."""
    if (steps == NO_STEP).any():
        return np.arange(len(steps))
    order = np.lexsort((steps, episodes))
    same = (np.diff(episodes[order]) == 0) & (np.diff(steps[order]) == 0)
    if same.any():
        row = order[int(np.argmax(same))]
        raise DatasetError(
            f"{path}: episode {episodes[row]} has two pushes with step {steps[row]}; each needs"
            " its own"
        )
    return steps
