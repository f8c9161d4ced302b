"""In which order the members of an ensemble see the data: a function of seed and epoch alone."""

from collections.abc import Iterator

import numpy as np
import torch
from jaxtyping import Int
from numpy import ndarray
from torch import Tensor

from sain_core.seeding import generator
from sain_model.network.settings import BOOTSTRAP, ORDER


class Batches:
    """Draws batches of rows for all members at once.

    Member 0 of a differently ordered ensemble sees what a lone network with that seed sees.
    """

    def __init__(
        self,
        seed: int,
        size: int,
        episodes: Int[ndarray, "M"],
        members: int = 1,
        diversity: str = ORDER,
        steps: int = 0,
    ) -> None:
        """Draw batches of a size from rows that belong to these episodes.

        `steps` are the batches in an epoch; 0: as many as one pass over the data takes.
        """
        self.count = len(episodes)
        self._seed = seed
        self._size = size
        self._members = members
        self._pass_steps = -(-self.count // size)
        self.steps = steps or self._pass_steps
        self._rows = [
            _bootstrap(seed, member, episodes) if diversity == BOOTSTRAP else np.arange(self.count)
            for member in range(members)
        ]

    def epoch(self, number: int) -> Iterator[Int[Tensor, "M b"]]:
        """Yield the rows of each batch of an epoch, counted from 0."""
        done = -1
        for step in range(number * self.steps, (number + 1) * self.steps):
            lap, place = divmod(step, self._pass_steps)
            if lap != done:
                batches, done = self._pass(lap).split(self._size, dim=1), lap
            yield batches[place]

    def _pass(self, number: int) -> Int[Tensor, "M rows"]:
        orders = []
        for member, rows in enumerate(self._rows):
            path = ("epoch", number) if member == 0 else ("epoch", number, "member", member)
            orders.append(rows[generator(self._seed, *path).permutation(self.count)])
        return torch.from_numpy(np.stack(orders))


def _bootstrap(seed: int, member: int, episodes: Int[ndarray, "M"]) -> Int[ndarray, "M"]:
    """Return as many rows as there are, of whole episodes drawn with replacement."""
    random = generator(seed, "bootstrap", "member", member)
    order = np.argsort(episodes, kind="stable")
    _, first, counts = np.unique(episodes[order], return_index=True, return_counts=True)
    rows: list[ndarray] = []
    drawn = 0
    while drawn < len(episodes):
        one = int(random.integers(len(first)))
        rows.append(order[first[one] : first[one] + counts[one]])
        drawn += counts[one]
    return np.concatenate(rows)[: len(episodes)]
