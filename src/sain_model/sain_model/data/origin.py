"""Where a data set is from, as its folder says: engine and world of a collection."""

from pathlib import Path
from typing import Any, Final

from sain_core.errors import DatasetError
from sain_core.guarding.untrusted import read_json
from sain_core.transitions import COLLECTION_FILE

BULLET: Final = "bullet"  # what a collection has that names no engine
RANDOMISED: Final = "randomised"


def made_in(path: Path) -> str:
    """Return engine and world of a folder, or of the folder of a shard; else the folder's name.

    Raises:
        DatasetError: its description is damaged.
    """
    folder = path if path.is_dir() else path.parent
    file = folder / COLLECTION_FILE
    if not file.exists():
        return folder.resolve().name
    try:
        truth: dict[str, Any] = read_json(file).get("truth", {})
        return f"{truth.get('engine', BULLET)} {truth.get('world', RANDOMISED)}"
    except (OSError, ValueError, AttributeError) as error:
        raise DatasetError(f"{file} is damaged: {error}") from error
