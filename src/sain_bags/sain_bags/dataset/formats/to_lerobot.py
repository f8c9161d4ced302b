"""LeRobot's format, version 3.0, through `lerobot`: a frame is a push, at one frame a second.

An unbroken sequence of pushes (see `StoredRows.sequences`) is an episode. Its frames hold the state
before the push (``observation.state``), the goal as a policy observes it, always finite
(``observation.environment_state``), images (``observation.images.*``), the push (``action``), what
became of it (``next.*``), and the other columns of the npz shards under their own names. Where
these have NaN, columns of the goal have 0, and one that no recording states is left out.
``timestamp`` counts frames; real times are in the stamps [ns]. LeRobot's loader has no unsigned
numbers: ids are stored as signed ones.
"""

import warnings
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_bags.dataset.formats.stored_rows import StoredRows, goal_distance, reached
from sain_bags.dataset.formats.videos import Videos
from sain_core.goal import observed_poses
from sain_core.policy import GOAL, STATE, names_of_numbers, task_of
from sain_core.pretrained import LeRobotDataset, SuppressProgressBars, write_info, write_stats
from sain_core.push import STROKE_NAMES
from sain_core.transitions import FRICTIONS, PARTS, POSED, Column, Columns
from sain_core.wire.images import CAMERAS

FRAMES_A_SECOND: Final = 1
NEXT_STATE: Final = "next.state"
RENAMED: Final[dict[str, str]] = {Column.STATE: STATE, Column.NEXT_STATE: NEXT_STATE}
REWARD: Final = "next.reward"
MAY_LACK: Final = {  # NaN where one recording of several lacks what a column is made of
    **{str(key): str(key) for key in FRICTIONS},
    REWARD: str(Column.GOAL_POSES),
}
TAKEN: Final[dict[str, Callable[[ndarray], Any]]] = {
    "min": np.min, "max": np.max, "mean": np.mean, "std": np.std,
    **{f"q{share:02}": partial(np.percentile, q=share) for share in (1, 10, 50, 90, 99)},
}  # fmt: skip


def write(rows: StoredRows, folder: Path) -> None:
    """Write a data set; the parts of its split follow one another, as ``info.json`` says."""
    dataset: Any = None
    videos: Any = None
    splits, count = {}, 0
    lacking: dict[str, list[ndarray]] = {}
    stated = rows.stated(MAY_LACK.values())
    unstated = [key for key, source in MAY_LACK.items() if source not in stated]
    with ExitStack() as stack:
        stack.enter_context(SuppressProgressBars())
        stack.enter_context(warnings.catch_warnings(action="ignore", category=RuntimeWarning))
        for part in PARTS:
            first = count
            for columns in rows.sequences(part):
                images = {key: columns.pop(key) for key in [*columns] if key.startswith(CAMERAS)}
                frames, recordings = _frames(columns, unstated), columns[Column.BAG_SHA256].tolist()
                if dataset is None:
                    shown = {
                        key: rows.image(recordings[0], key, int(images[key][0])) for key in images
                    }
                    dataset = _create(folder, frames | shown, rows)
                    stack.callback(dataset.finalize)  # else it writes when it is freed, or never
                    videos = Videos(dataset, _finite_stats) if images else None
                for key, times in images.items():
                    seen = zip(recordings, times.tolist(), strict=True)
                    videos.add(key, (rows.image(sha256, key, time) for sha256, time in seen))
                _save(dataset, frames, task_of(rows.disks))
                for key in frames.keys() & MAY_LACK.keys():
                    lacking.setdefault(key, []).append(frames[key])
                count += 1
            splits[part] = f"{first}:{count}"
    dataset.meta.info["splits"] = splits
    dataset.meta.update_video_info()
    write_info(dataset.meta.info, folder)
    stats = dict(sorted(dataset.meta.stats.items()))  # else in the order of hashes
    for key, values in lacking.items():
        stats |= {key: _finite_stats(np.concatenate(values))}
    write_stats({key: found for key, found in stats.items() if found["count"].any()}, folder)


def _finite_stats(values: ndarray) -> dict[str, ndarray]:
    """Return the statistics of the finite numbers in each column.

    `lerobot` takes those of all numbers: a friction that one recording lacks makes all of them
    NaN, which is no JSON. A column without any finite number has 0; the count says whether all do.
    """
    columns = values.reshape(len(values), -1).T.astype(np.float64)
    known = [column[np.isfinite(column)] for column in columns]
    filled = [column if len(column) else np.zeros(1) for column in known]
    found = {name: np.array([take(column) for column in filled]) for name, take in TAKEN.items()}
    return found | {"count": np.array([max(map(len, known))])}


def _create(folder: Path, frames: Columns, rows: StoredRows) -> LeRobotDataset:
    names = names_of_numbers(rows.disks)
    named = names | dict.fromkeys((NEXT_STATE, Column.PHYSICS_NEXT), names[STATE])
    named |= {Column.ACTION: list(STROKE_NAMES[: frames[Column.ACTION].shape[1]])}
    features = {
        key: {
            "dtype": "string" if values.dtype.kind == "U" else str(values.dtype),
            "shape": values.shape[1:] or (1,),
            "names": named.get(key),
        }
        if not key.startswith(CAMERAS)
        else {"dtype": "video", "shape": values.shape, "names": ["height", "width", "channels"]}
        for key, values in frames.items()
    }
    return LeRobotDataset.create(
        rows.name,
        fps=FRAMES_A_SECOND,
        features=features,
        root=folder,
        use_videos=any(key.startswith(CAMERAS) for key in frames),
        video_backend="pyav",  # or it looks for another, and says what it did not find
    )


def _frames(columns: Columns, unstated: Iterable[str]) -> Columns:
    """Return the columns of a frame, by LeRobot's keys, without those that nothing states."""
    frames = {RENAMED.get(key, key): _storable(values) for key, values in columns.items()}
    count = len(columns[Column.EPISODE])
    observed = observed_poses(columns[Column.GOAL_POSES].reshape(count, -1, 3))
    frames[GOAL] = observed.reshape(count, -1)
    frames[REWARD] = -goal_distance(columns)
    frames["next.success"] = reached(columns)
    frames["next.done"] = np.arange(count) == count - 1
    frames |= {key: np.nan_to_num(frames[key]) for key in map(str, POSED)}
    return {key: values for key, values in frames.items() if key not in unstated}


def _storable(values: ndarray) -> ndarray:
    """Return values as `lerobot` takes them: signed, and without an axis for one number."""
    values = values[:, 0] if values.shape[1:] == (1,) else values
    return values.view(np.int64) if values.dtype == np.uint64 else values


def _save(dataset: LeRobotDataset, frames: Columns, task: str) -> None:
    """Save an episode, as a whole: frame by frame `lerobot` cannot, with NumPy from 2.4 on."""
    count = len(frames[Column.ACTION])
    episode = dataset.create_episode_buffer()
    episode |= {key: list(values) for key, values in frames.items()}
    episode["frame_index"] = list(range(count))
    episode["timestamp"] = [index / FRAMES_A_SECOND for index in range(count)]
    episode |= {"size": count, "task": [task] * count}
    meta, save = dataset.meta, type(dataset.meta).save_episode
    finite = {key: _finite_stats(values) for key, values in frames.items() if key in MAY_LACK}

    def save_finite(*about: Any) -> None:  # index, length, tasks, statistics and more
        save(meta, *about[:3], about[3] | finite, *about[4:])

    meta.save_episode = save_finite
    dataset.save_episode(episode)
