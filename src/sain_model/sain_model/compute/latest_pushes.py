"""What was computed for each push of a history, kept for the next one: that has one push more."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.history import PushHistory
from sain_core.types import Pushes, Scenes

Rows = Float[ndarray, "M F ..."]


class LatestPushes:
    """Rows of numbers, one for each push of the latest history. For any thread."""

    def __init__(self) -> None:
        """Begin without a push."""
        self._kept: dict[bytes, Float[ndarray, "F ..."]] = {}

    def rows(self, past: PushHistory, compute: Callable[[Scenes, Pushes, Scenes], Rows]) -> Rows:
        """Return what `compute` returns for all pushes; it is asked about the new ones only.

        What it returns for a push may not depend on the pushes beside it.
        """
        kept, columns = self._kept, (past.state, past.action, past.next_state)
        keys = [b"".join(column[row].tobytes() for column in columns) for row in range(len(past))]
        new = [row for row, key in enumerate(keys) if key not in kept]
        if new or not keys:
            fresh = compute(*(column[new] for column in columns))
            if len(new) == len(keys):
                self._kept = dict(zip(keys, fresh, strict=True))
                return fresh
            kept = kept | {keys[row]: one for row, one in zip(new, fresh, strict=True)}
        self._kept = {key: kept[key] for key in keys}
        return np.stack([kept[key] for key in keys])
