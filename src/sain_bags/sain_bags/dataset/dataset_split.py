"""The split of a data set: episodes for training, validation and test."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from sain_core.dataset import PARTS, SEED, SHARES, TRAIN, draw_parts
from sain_core.errors import DatasetError

Episodes = dict[str, frozenset[int]]  # by part
Counts = Mapping[tuple[int, int], int]  # of rows, by number of disks and episode


def split_episodes(counts: Counts) -> Episodes:
    """Split as `sain_model train` does by default; too few episodes are all for training."""
    labels = [episode for _, episode in sorted(counts)]
    try:
        masks = draw_parts(np.arange(len(labels)), SEED, *SHARES.values())
    except DatasetError:
        drawn = [TRAIN] * len(labels)
    else:
        drawn = np.select(masks, PARTS, "").tolist()
    parts: dict[int, str] = {}
    for episode, part in zip(labels, drawn, strict=True):
        parts.setdefault(episode, part)  # where disks came or went it stands there twice
    return {
        part: frozenset(episode for episode in parts if parts[episode] == part) for part in PARTS
    }


def describe_split(episodes: Episodes, counts: Counts) -> dict[str, Any]:
    """Return the split for the card; episodes that it does not name are for training."""
    rows = {
        part: sum(count for (_, episode), count in counts.items() if episode in episodes[part])
        for part in PARTS
    }
    named = {part: sorted(episodes[part]) for part in PARTS if part != TRAIN}
    return {"seed": SEED, "shares": SHARES, "transitions": rows, "episodes": named}
