"""How many threads the network computes with: one.

PyTorch takes all cores unless told otherwise, and follows whoever sets OpenMP's number of threads,
as Numba's parallel loops do. The network's operations are too small for that: on two busy cores
each waits for a thread that has no core, and a rollout of 1024 x 6 pushes took 0.95 s instead of
0.07 s.
"""

from typing import Final

import torch

NETWORK_THREADS: Final = 1


def settle_threads() -> None:
    """Take PyTorch back to one thread; cheap. Call it before the network."""
    if torch.get_num_threads() != NETWORK_THREADS:
        torch.set_num_threads(NETWORK_THREADS)
