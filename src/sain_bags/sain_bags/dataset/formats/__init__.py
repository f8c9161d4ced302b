"""The formats of data sets, each written through its own library, one page of code each.

Whatever the format, rows are first gathered in npz shards. With npz these are the data set; what
writes another format streams them, as often as it needs, once all rows are known and with them
which episode belongs to which part of the split.
"""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Final, Literal

from sain_bags.dataset.formats.stored_rows import StoredRows
from sain_core.errors import ConfigError
from sain_core.transitions import PARTS, SHARD_PATTERN

FormatName = Literal["npz", "parquet", "lerobot"]
Write = Callable[[StoredRows, Path], None]  # rows into a folder that does not exist yet

SHARDS: Final = "npz"  # the format that rows are gathered in
VIDEOS: Final = "lerobot"  # the format that has images
FILE: Final = "chunk-[0-9][0-9][0-9]/file-[0-9][0-9][0-9]"
MADE: Final[dict[FormatName, tuple[str, ...]]] = {  # patterns of all files of a data set
    SHARDS: (SHARD_PATTERN,),
    "parquet": tuple(f"{part}-{5 * '[0-9]'}.parquet" for part in PARTS),
    "lerobot": (
        f"data/{FILE}.parquet",
        f"meta/episodes/{FILE}.parquet",
        f"videos/observation.images.*/{FILE}.mp4",
        *(f"meta/{name}" for name in ("info.json", "stats.json", "tasks.parquet")),
    ),
}


def find_format(name: FormatName) -> Write | None:
    """Return the function that writes a format; None for npz, which shards already are."""
    if name == SHARDS:
        return None
    try:
        write: Write = import_module(f"sain_bags.dataset.formats.to_{name}").write
    except ImportError as error:
        raise ConfigError(
            f"--format {name} needs {error.name or error}, which is not installed; install it with"
            f" pip install '.[{name}]' in the checkout, or choose --format {SHARDS}"
        ) from error
    return write
