"""How many threads compute what: blocks of kernels on all of Numba's, the network on one.

The kernels let go of Python's lock, so that Python's own threads can run them side by side. What
a block computes does not depend on who computes it. Against Numba's parallel loops, a core that is
busy with something else gets fewer blocks, kernels compile in a third of the time, and no thread
spins for milliseconds when it is done, as OpenMP's do, on a core that something else could use.

PyTorch takes all cores unless told otherwise, and follows whoever sets OpenMP's number of threads.
The network's operations are too small for that: on two busy cores each waits for a thread that has
no core, and a rollout of 1024 x 6 pushes took 0.95 s instead of 0.07 s.
"""

import functools
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Final

import numba


def run_blocks(work: Callable[[int], None], total: int, size: int) -> None:
    """Call `work` with the first number of each block: 0, size, 2 size, ... below `total`."""
    blocks = iter(range(0, total, size))  # a thread takes the next one under Python's lock

    def take() -> None:
        for first in blocks:
            work(first)

    helpers = min(numba.get_num_threads(), -(-total // size)) - 1
    helping = [_pool().submit(take) for _ in range(helpers)]
    take()
    for helper in helping:
        if not helper.cancel():  # on a busy machine it may not have begun, and there is no need
            helper.result()


def even_blocks(total: int, most: int) -> int:
    """Return a size of blocks, at most `most`, of which all threads have equally many."""
    threads = numba.get_num_threads()
    each = max(-(-total // (most * threads)), 1)
    return max(-(-total // (each * threads)), 1)


@functools.cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(numba.config.NUMBA_NUM_THREADS, "sain-blocks")  # type: ignore[attr-defined]


os.register_at_fork(after_in_child=_pool.cache_clear)  # a child process has none of the threads


NETWORK_THREADS: Final = 1


def settle_threads() -> None:
    """Take PyTorch back to one thread; cheap. Call it before the network."""
    import torch  # takes a second, which physics alone does not wait for

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
