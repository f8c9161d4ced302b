"""Push ids that nobody else uses."""

from itertools import count
from secrets import randbits
from typing import Final

RANDOM_BITS: Final = 32
COUNTER_BITS: Final = 20  # together below 2^53: exact also where numbers are doubles


def push_ids() -> "count[int]":
    """Return ids from a random start, a million apart from those of other senders."""
    return count((randbits(RANDOM_BITS) << COUNTER_BITS) + 1)
