"""Transitions (s, a, f_p(s, a), s') of scenes with any bodies, and their split by episode.

Scenes of N = 2 and N = 5 fit into no common array, nor do pushes and strokes: a data set has one
`Part` for all of the same bodies and width. Episodes of different folders never have the same
label, and a push that is in two of the folders is refused: it could end up on both sides of a
split.

Windows: successive pushes of one episode, to roll a model out over.

A window starts at a push and goes on with those that came right after it, as long as the scene
after one push is, to the bit, the scene before the next. Where pushes are missing between two,
as after the paper's 2 mm filter, no window spans the gap; none ever spans two episodes.
"""

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from sain_core.errors import DatasetError
from sain_core.guarding.documents import read_json
from sain_core.push import idle_pushes, mirror_pushes
from sain_core.scene import POSE, mirror_scenes
from sain_core.shapes.bodies import bodies_named
from sain_core.transitions import (
    COLLECTION_FILE,
    NEEDED,
    NO_STEP,
    SHAPED,
    Column,
    Columns,
    draw_parts,
    read_shard,
    shard_paths,
)
from sain_core.types import Mask, Scalars, Scenes
from sain_model.inference.evidence import ObservedPushes

# --- data sets ------------------------------------------------------------------------------------

BULLET: Final = "bullet"  # what a collection has that names no engine
RANDOMISED: Final = "randomised"


def made_in(path: Path) -> str:
    """Return engine and world of a folder, or of the folder of a shard; else the folder's name.

    Raises `DatasetError`: its description is damaged.
    """
    folder = path if path.is_dir() else path.parent
    file = folder / COLLECTION_FILE
    if not file.exists():
        return folder.resolve().name
    try:
        truth: dict[str, Any] = read_json(file).get("truth", {})
        return f"{truth.get('engine', BULLET)} {truth.get('world', RANDOMISED)}"
    except (OSError, ValueError, AttributeError) as error:
        raise DatasetError(f"{file} is damaged: {error}") from error


Order = tuple[int, str, tuple[str, ...], int]


@dataclass(frozen=True, eq=False, kw_only=True)
class Part(ObservedPushes):
    """M pushes in scenes of the same bodies, with what physics predicted and what happened.

    Values that are `given` are believed for each push, besides what episodes show.
    """

    physics_next: Scenes  # (M, N, 8), the nominal world's prediction, the paper's f_p
    # its place in the episode: the order of the data where no ``step`` is given
    step: Int[ndarray, "M"]
    friction: Scalars  # the true friction with the table; NaN where it is not known
    floor_next: Scenes  # the same push repeated in a world set to the observed state; NaN likewise
    # what the body stood on, in a real robot's pushes; empty where it is not stated
    surface: ndarray | None = None
    object: ndarray | None = None  # the pushed body, as its user calls it; likewise
    run: ndarray | None = None  # the recording; likewise
    # engine, world and bottom of the scenes, or the data set's name; None: likewise
    setting: ndarray | None = None

    def mirrored(self) -> Self:
        """Return what would have happened in a mirror: the same physics."""
        scenes = (Column.STATE, Column.PHYSICS_NEXT, Column.NEXT_STATE, Column.FLOOR_NEXT)
        mirrored: dict[str, Any] = {n: mirror_scenes(getattr(self, n)) for n in scenes}
        return replace(self, action=mirror_pushes(self.action), **mirrored)


@dataclass(frozen=True, eq=False)
class Dataset:
    """M pushes of scenes with any bodies."""

    # those of the same bodies and width of pushes each; disks first, by their number
    parts: tuple[Part, ...]
    sha256: str = ""  # of all parts
    # SHA-256 of each folder and number of bodies that it was put together from; empty: it is one
    sources: tuple[str, ...] = ()

    def __len__(self) -> int:
        return sum(len(part) for part in self.parts)

    @property
    def episode(self) -> Int[ndarray, "M"]:
        """Which episode each push belongs to, part by part; no two parts share one."""
        return self._column(Column.EPISODE)

    @property
    def alike(self) -> Part:
        """All pushes, where scenes have the same bodies; raises `DatasetError`: they have not."""
        if len(self.parts) == 1:
            return self.parts[0]
        names = "; ".join(", ".join(s.name for s in part.bodies.shapes) for part in self.parts)
        widths = len({part.action.shape[1] for part in self.parts})
        strokes = " as pushes and as strokes" if widths > 1 else ""
        raise DatasetError(
            f"scenes with the same bodies are needed, not: {names}{strokes}; give one folder"
        )

    def select(self, rows: Mask) -> Self:
        """Return the pushes that a mask (M,) over all parts picks."""
        ends = np.cumsum([len(part) for part in self.parts])[:-1]
        masks = np.split(rows, ends)
        picked = (part.select(mask) for part, mask in zip(self.parts, masks, strict=True))
        return replace(self, parts=tuple(part for part in picked if len(part)))

    @property
    def counts(self) -> dict[str, int]:
        """How many pushes there are in each setting."""
        settings = [part.setting for part in self.parts if part.setting is not None]
        if not settings:
            return {}
        names, counts = np.unique(np.concatenate(settings), return_counts=True)
        return dict(zip(names.tolist(), counts.tolist(), strict=True))

    def _column(self, name: str) -> Int[ndarray, "M"]:
        columns = (getattr(part, name) for part in self.parts)
        return np.concatenate([np.zeros(0, np.int64), *columns])


@dataclass(frozen=True)
class Split:
    """Three sets of transitions without a common episode."""

    train: Dataset
    validation: Dataset
    test: Dataset

    @property
    def held_out(self) -> Dataset:
        """What errors are measured on: the test part, or without one the validation part."""
        return self.test if len(self.test) else self.validation


def load_dataset(*paths: Path) -> Dataset:
    """Read one or more shards or folders of them as one data set.

    Raises `DatasetError`: nothing there, a damaged shard, a missing key, arrays that do not fit
    together, NaN or Inf; or a push that is in two of the folders.
    """
    sources = [(path, *read) for path in paths for read in _read_folder(path)]
    _check_apart([(path, part) for path, part, _ in sources])
    hashes = tuple(dict.fromkeys(sha256 for *_, sha256 in sources))
    parts: dict[Order, list[Part]] = {}
    for part in _labelled([part for _, part, _ in sources]):
        parts.setdefault(_order(part), []).append(part)
    joined = tuple(_joined(parts[key]) for key in sorted(parts))
    if len(hashes) == 1:
        return Dataset(joined, hashes[0])
    return Dataset(joined, hashlib.sha256(" ".join(hashes).encode()).hexdigest(), hashes)


def split_by_episode(data: Dataset, seed: int, validation: float, test: float) -> Split:
    """Split transitions so that no episode is in two parts; see `sain_core.transitions.draw_parts`.

    With no share for the test, training and validation share all: 90 to 10 or 80 to 20 in the
    paper. Raises `DatasetError`: too few episodes for the parts.
    """
    return Split(*map(data.select, draw_parts(data.episode, seed, validation, test)))


# --- reading --------------------------------------------------------------------------------------


def _read_folder(path: Path) -> Iterable[tuple[Part, str]]:
    """Yield what a folder holds by the bodies, and the SHA-256 of scenes of as many."""
    shards, made = [read_shard(shard) for shard in shard_paths(path)], made_in(path)
    sizes = [(s[Column.STATE].shape[1], s[Column.ACTION].shape[1]) for s in shards]
    for size in sorted(set(sizes)):
        count, _ = size
        alike = [shard for shard, own in zip(shards, sizes, strict=True) if own == size]
        columns = {name: np.concatenate([shard[name] for shard in alike]) for name in alike[0]}
        digest = hashlib.sha256()
        for column in NEEDED:
            digest.update(np.ascontiguousarray(columns[column]).tobytes())
        kinds = [columns.pop(name) for name in SHAPED]
        names = np.array([";".join(row) for row in zip(*kinds, strict=True)])
        columns[Column.STEP] = _steps(path, columns)
        for name in np.unique(names):
            chosen: dict[str, Any] = {key: rows[names == name] for key, rows in columns.items()}
            bodies = bodies_named(*str(name).split(";"), count)
            setting = np.full((names == name).sum(), f"{made}, {bodies.shapes[0].bottom}")
            yield Part(**chosen, bodies=bodies, setting=setting), digest.hexdigest()


def _steps(path: Path, columns: Columns) -> Int[ndarray, "M"]:
    """Return the place of each push in its episode; the order of the data where none is given."""
    episodes, steps = columns[Column.EPISODE], columns[Column.STEP]
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


def _order(part: Part) -> Order:
    """Return what parts are put together and sorted by: disks by their number."""
    width = part.action.shape[1]
    if part.bodies.are_paper_disks:
        return part.disks, "", (), width
    first, *others = (shape.name for shape in part.bodies.shapes)
    return 0, f"{first}|{'|'.join(others)}", part.bodies.roles, width


def _labelled(parts: list[Part]) -> list[Part]:
    """Return parts of which no two have an episode of the same label."""
    found = [np.unique(part.episode, return_inverse=True) for part in parts]
    if len(np.unique(np.concatenate([names for names, _ in found]))) == sum(
        len(names) for names, _ in found
    ):
        return parts
    firsts = np.cumsum([0, *(len(names) for names, _ in found)])
    return [
        replace(part, episode=first + labels)
        for part, (_, labels), first in zip(parts, found, firsts[:-1], strict=True)
    ]


def _joined(parts: Sequence[Part]) -> Part:
    """Return parts of the same bodies and with labels of their own as one."""
    columns = [part.arrays for part in parts]
    arrays: dict[str, Any] = {
        name: np.concatenate([column[name] for column in columns]) for name in columns[0]
    }
    return replace(parts[0], **arrays)


def _check_apart(sources: Sequence[tuple[Path, Part]]) -> None:
    """Raise `DatasetError` when the same push from the same scene is in two places."""
    seen: dict[bytes, Path] = {}
    for path, part in sources:
        flat = np.concatenate([part.state.reshape(len(part), -1), part.action], axis=-1)
        keys = {row.tobytes() for row in flat}
        for key in keys & seen.keys():
            raise DatasetError(
                f"{seen[key]} and {path} hold the same push; give each data set once"
            )
        seen |= dict.fromkeys(keys, path)


@dataclass(frozen=True, eq=False)
class Windows:
    """W windows of up to T successive pushes."""

    rows: Int[ndarray, "W T"]  # which transition of the data each push is; -1 behind a window's end
    scenes: Float[ndarray, "W N 8"]  # before the first push
    pushes: Float[ndarray, "W T A"]  # of zero length behind a window's end: nothing moves there
    next_scenes: Float[ndarray, "W T N 8"]  # after each push; behind the end the last one again
    episodes: Int[ndarray, "W"]  # which episode each window is of

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def steps(self) -> int:
        """The most pushes T of a window."""
        return int(self.rows.shape[1])

    @property
    def known(self) -> Bool[ndarray, "W T"]:
        """Which steps were pushed; the others are behind a window's end."""
        return np.asarray(self.rows >= 0)

    def and_then(self, others: Self) -> Self:
        """Return these windows and others of as many steps."""
        joined = {
            name: np.concatenate([array, getattr(others, name)])
            for name, array in vars(self).items()
        }
        return type(self)(**joined)

    def select(self, which: ndarray) -> Self:
        """Return the windows that a mask (W,) or indices pick."""
        return type(self)(**{name: array[which] for name, array in vars(self).items()})


def make_windows(data: Part, steps: int) -> Windows:
    """Return one window of at most so many pushes from every push of the data on."""
    after = following(data)
    rows = np.full((len(data), steps), -1)
    rows[:, 0] = np.arange(len(data))
    for step in range(1, steps):
        before = rows[:, step - 1]
        rows[:, step] = np.where(before >= 0, after[before], -1)
    last = np.maximum.accumulate(np.where(rows >= 0, np.arange(steps), 0), axis=1)
    filled = np.take_along_axis(rows, last, axis=1)
    idle = idle_pushes(size=data.action.shape[1])
    pushes = np.where((rows >= 0)[..., None], data.action[filled], idle)
    first = rows[:, 0]
    return Windows(rows, data.state[first], pushes, data.next_state[filled], data.episode[first])


def following(data: Part) -> Int[ndarray, "M"]:
    """Return which push came right after each push (M,) in its episode; -1 where none did."""
    order = np.lexsort((data.step, data.episode))
    this, following_one = order[:-1], order[1:]
    follows = data.episode[this] == data.episode[following_one]
    follows &= data.step[following_one] == data.step[this] + 1
    poses = data.next_state[this][..., POSE], data.state[following_one][..., POSE]
    follows &= (poses[0] == poses[1]).all(axis=(1, 2))
    after = np.full(len(data), -1)
    after[this[follows]] = following_one[follows]
    return after
