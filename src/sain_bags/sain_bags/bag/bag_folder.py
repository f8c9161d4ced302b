"""The files of a bag."""

from pathlib import Path, PurePath
from typing import Any

import yaml

from sain_bags.bag.metadata import METADATA_FILE
from sain_bags.mcap.integrity import RESCUE
from sain_core.errors import DatasetError


def find_files(path: Path) -> tuple[dict[str, Any], tuple[Path, ...]]:
    """Return the content of a bag's ``metadata.yaml``, and its files; for a file, the file alone.

    Raises:
        DatasetError: it is no bag, or was not closed.
    """
    if path.suffix == ".db3" and path.is_file():
        raise DatasetError(f"{path} is a file of a sqlite3 bag; name the folder that it is in")
    if path.is_file():
        return {}, (path,)
    if not path.is_dir():
        raise DatasetError(f"no bag at {path}")
    if not (path / METADATA_FILE).is_file():
        if not any(path.glob("*.mcap")):
            raise DatasetError(f"{path} is no bag: it has no {METADATA_FILE}")
        raise DatasetError(f"{path} was not closed: it has no {METADATA_FILE}; {RESCUE}")
    metadata = _read_metadata(path / METADATA_FILE)
    named = metadata.get("relative_file_paths") or []
    # Up to version 3 of the layout the folder's name stood before the file's.
    files = tuple(path / PurePath(name).name for name in named)
    missing = [file.name for file in files if not file.is_file()]
    if not files or missing:
        what = f"; {missing[0]} is not there" if missing else ""
        raise DatasetError(f"{path / METADATA_FILE} names the files {named}{what}")
    return metadata, files


def _read_metadata(path: Path) -> dict[str, Any]:
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        return dict(content["rosbag2_bagfile_information"])
    except (OSError, ValueError, TypeError, KeyError, yaml.YAMLError) as error:
        raise DatasetError(
            f"{path} cannot be read ({error}); `ros2 bag reindex` makes a new one"
        ) from error
