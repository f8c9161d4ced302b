"""The split by episode: pushes of one episode never stand on two sides of it.

Pushes of an episode share its friction, masses and radii; on both sides of a split, they would
tell what is to be held out.
"""

from typing import Final

import numpy as np
from jaxtyping import Int
from numpy import ndarray

from sain_core.errors import DatasetError
from sain_core.seeding import generator
from sain_core.types import Mask

TRAIN, VALIDATION, TEST = PARTS = ("train", "validation", "test")
SEED: Final = 0  # what is drawn where nobody asks for another
SHARES: Final = {VALIDATION: 0.1, TEST: 0.15}  # of the episodes, where nobody asks for others


def draw_parts(
    labels: Int[ndarray, "M"], seed: int, validation: float, test: float
) -> tuple[Mask, Mask, Mask]:
    """Return which rows (M,) are to train, validate and test on.

    Args:
        labels: the episode of each row.
        seed: decides which episodes go where.
        validation: share of the episodes to choose the best epoch by.
        test: share of the episodes held out; 0: none are.

    Raises:
        DatasetError: too few episodes for the parts.
    """
    episodes = np.unique(labels)
    held = [max(round(share * len(episodes)), 1) if share else 0 for share in (validation, test)]
    if len(episodes) <= sum(held):
        wanted = "train, validate and test" if test else "train and validate"
        raise DatasetError(f"{len(episodes)} episodes are too few to {wanted}")
    shuffled = generator(seed, "split").permutation(episodes)
    in_test = np.isin(labels, shuffled[: held[1]])
    in_validation = np.isin(labels, shuffled[held[1] : sum(held)])
    return ~(in_test | in_validation), in_validation, in_test
