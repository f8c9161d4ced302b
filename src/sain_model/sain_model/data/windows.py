"""Windows: successive pushes of one episode, to roll a model out over.

A window starts at a push and goes on with those that came right after it, as long as the scene
after one push is, to the bit, the scene before the next. Where pushes are missing between two,
as after the paper's 2 mm filter, no window spans the gap; none ever spans two episodes.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from sain_core.errors import DatasetError
from sain_core.push import idle_pushes
from sain_core.scene import POSE
from sain_model.data.dataset import Part


@dataclass(frozen=True, eq=False)
class Windows:
    """W windows of up to T successive pushes.

    Attributes:
        rows: which transition of the data each push is; -1 behind a window's end.
        scenes: before the first push.
        pushes: of zero length behind a window's end: nothing moves there.
        next_scenes: after each push; behind a window's end the last one again.
        episodes: which episode each window is of.
    """

    rows: Int[ndarray, "W T"]
    scenes: Float[ndarray, "W N 8"]
    pushes: Float[ndarray, "W T A"]  # five numbers, or a stroke's eight
    next_scenes: Float[ndarray, "W T N 8"]
    episodes: Int[ndarray, "W"]

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


def make_windows(data: Part, steps: int, whole: bool = False) -> Windows:
    """Return one window of at most so many pushes from every push of the data on.

    `whole`: only windows of all T pushes, not the shorter ones at the end of an episode.

    Raises:
        DatasetError: no window is left.
    """
    after = following(data)
    rows = np.full((len(data), steps), -1)
    rows[:, 0] = np.arange(len(data))
    for step in range(1, steps):
        before = rows[:, step - 1]
        rows[:, step] = np.where(before >= 0, after[before], -1)
    if whole:
        rows = rows[rows[:, -1] >= 0]
    if len(rows) == 0:
        raise DatasetError(f"no episode has {steps} successive pushes; fewer, or longer episodes")
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
