"""What data sets on disk have in common, whether collected or converted: the paper's shards."""

from pathlib import Path
from typing import Final

SHARD_SIZE: Final = 1000  # transitions, as in the paper (section III-B c)
SHARD_PATTERN: Final = "shard-*.npz"
MOVED: Final = 0.002  # [m], the paper's threshold for a target that moved (section III-B b)


def shard_path(folder: Path, index: int) -> Path:
    """Return where the index-th shard is."""
    return folder / f"shard-{index:05d}.npz"
