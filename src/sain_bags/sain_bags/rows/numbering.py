"""Episode and step of each row in a data set of many recordings."""

from collections.abc import Sequence

import numpy as np

from sain_bags.rows.rows import RowBlock
from sain_core.transitions import Column


class Numbering:
    """Counts episodes over all recordings, and the steps of each.

    A simulator that is started anew counts its episodes and scenes from 1 again: where a number
    goes back, another episode has begun. Where scene ids show pushes between two rows,
    steps have a gap, as in a filtered collection.
    """

    def __init__(self) -> None:
        """Begin with episode 0."""
        self.episodes = 0
        self._step = 0
        self._last: tuple[str, int, int] = ("", 0, 0)  # bag, and its numbers

    def number(self, blocks: Sequence[RowBlock], bag: str) -> Sequence[RowBlock]:
        """Add `episode`, `step` and `bag_sha256` to the next rows; return them."""
        if not blocks:
            return blocks
        order = np.argsort(np.concatenate([block.places for block in blocks]))
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        named, scenes = (
            np.concatenate([block.columns[name] for block in blocks])[order].astype(np.int64)
            for name in (Column.BAG_EPISODE, Column.BAG_SCENE)
        )
        episodes, steps = self._count(named, scenes, bag)
        ends = np.cumsum([len(block.places) for block in blocks])
        for block, places in zip(blocks, np.split(back, ends[:-1]), strict=True):
            block.columns[Column.EPISODE] = episodes[places]
            block.columns[Column.STEP] = steps[places]
            block.columns[Column.BAG_SHA256] = np.full(len(places), bag)
        return blocks

    def _count(
        self, episode_ids: np.ndarray, scene_ids: np.ndarray, bag: str
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the episodes and steps of rows (M,) in their order."""
        last_bag, last_episode, last_scene = self._last
        ahead = np.diff(scene_ids, prepend=last_scene)
        goes_on = (np.diff(episode_ids, prepend=last_episode) == 0) & (ahead >= 0)
        goes_on[0] &= bag == last_bag
        walked = self._step + np.cumsum(np.where(goes_on, np.maximum(ahead, 1), 0))
        episodes = self.episodes + np.cumsum(~goes_on) - 1
        begun = np.where(goes_on, 0, walked)  # where the episode of each row began
        steps = walked - np.maximum.accumulate(begun)
        self.episodes, self._step = int(episodes[-1]) + 1, int(steps[-1])
        self._last = (bag, int(episode_ids[-1]), int(scene_ids[-1]))
        return episodes, steps
