"""The folder that a data set is written to: whose it is, and when it is whole.

``conversion.json`` is written before the first shard and says which conversion the folder belongs
to; ``card.json`` is written last, and where it stands the data set is whole.
"""

import json
from pathlib import Path
from typing import Any, Final

from numpy import ndarray

from sain_bags.dataset_shards import write_shard
from sain_core.errors import OutputError
from sain_core.shards import SHARD_PATTERN
from sain_core.storage import PARTIAL, write_json

IDENTITY_FILE: Final = "conversion.json"
CARD_FILE: Final = "card.json"
PICTURE_FILE: Final = "card.png"  # drawn from the card

Content = dict[str, Any]


class DatasetFolder:
    """Takes the shards and the card of one conversion."""

    def __init__(self, path: Path, identity: Content, overwrite: bool = False) -> None:
        """Look at the folder; nothing is written or deleted before the first shard.

        Args:
            path: a new or empty folder, or that of a conversion.
            identity: what makes two conversions the same; as JSON would give it back.
            overwrite: make anew what a conversion made there.

        Raises:
            OutputError: it holds something else, or another conversion and is not to be
                overwritten.
        """
        self.path, self._identity = path, identity
        self._overwrite, self._claimed, self._shards = overwrite, False, 0
        found = _read_identity(path)
        if found is not None and found != identity and not overwrite:
            raise OutputError(
                f"{path} holds another conversion ({_difference(found, identity)}); choose another"
                " folder, or --overwrite"
            )

    def store(self, columns: dict[str, ndarray]) -> dict[str, ndarray]:
        """Write columns as the next shard, or find it written, and return them.

        Raises:
            DatasetError: what is there is damaged or differs.
            OutputError: the folder cannot be written, or the disk is full.
        """
        if not self._claimed:
            self._claim()
        self._shards += 1
        return write_shard(self.path, self._shards - 1, columns)

    def finish(self, card: Content) -> None:
        """Write the card: the data set is whole."""
        write_json(self.path / CARD_FILE, card)

    def _claim(self) -> None:
        leftovers = [*self.path.glob(f".*{PARTIAL}")]
        leftovers += [self.path / name for name in (CARD_FILE, PICTURE_FILE)]
        if self._overwrite:
            leftovers += sorted(self.path.glob(SHARD_PATTERN))
        try:
            for path in leftovers:
                path.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(f"cannot clear {self.path}: {error.strerror or error}") from error
        write_json(self.path / IDENTITY_FILE, self._identity)
        self._claimed = True


def _read_identity(folder: Path) -> Content | None:
    """Return what the folder says whose it is; None: it is new or empty.

    Raises:
        OutputError: it is no folder, or holds what no conversion has made.
    """
    path = folder / IDENTITY_FILE
    try:
        if not folder.exists() or not any(folder.iterdir()):
            return None
        content = json.loads(path.read_text(encoding="utf-8"))
    except NotADirectoryError as error:
        raise OutputError(f"{folder} is a file; choose a folder") from error
    except FileNotFoundError as error:
        raise OutputError(
            f"{folder} holds files, and no {IDENTITY_FILE} says that a conversion made them;"
            " choose another folder"
        ) from error
    except (OSError, ValueError) as error:
        raise OutputError(f"{path} cannot be read ({error}); choose another folder") from error
    if not isinstance(content, dict):
        raise OutputError(f"{path} is damaged; choose another folder")
    return content


def _difference(found: Content, wanted: Content) -> str:
    name = next(key for key in {**wanted, **found} if found.get(key) != wanted.get(key))
    return f"{name} = {found.get(name)!r}, not {wanted.get(name)!r}"
