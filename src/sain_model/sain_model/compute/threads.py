"""How many threads the network computes with: one.

PyTorch takes all cores unless told otherwise, and follows whoever sets OpenMP's number of threads,
as Numba's parallel loops do. The network's operations are too small for that: on two busy cores
each waits for a thread that has no core, and a rollout of 1024 x 6 pushes took 0.95 s instead of
0.07 s.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import numba
import torch

NETWORK_THREADS: Final = 1


def settle_threads() -> None:
    """Take PyTorch back to one thread; cheap. Call it before the network."""
    if torch.get_num_threads() != NETWORK_THREADS:
        torch.set_num_threads(NETWORK_THREADS)


@contextmanager
def one_numba_thread() -> Iterator[None]:
    """Run compiled loops on one thread, for small batches by the hundred.

    Their threads wait for each other at the end of every batch: on two cores that others use too,
    rollouts of 64 windows took ten times as long with two threads as with one.
    """
    before = numba.get_num_threads()
    numba.set_num_threads(1)
    try:
        yield
    finally:
        numba.set_num_threads(before)
