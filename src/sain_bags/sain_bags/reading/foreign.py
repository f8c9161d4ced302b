"""Bags that are no MCAP files, or that rosbag2 compressed: copied, for as long as they are read."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from rosbags.rosbag2 import Reader

from sain_bags.bag.definitions import Definitions
from sain_bags.bag.metadata import METADATA_FILE, Topic
from sain_bags.writing.writer import BagConfig, BagWriter
from sain_core.errors import DatasetError, InvalidInputError

UNCOMPRESSED = ("", "none")


def is_foreign(metadata: dict[str, Any]) -> bool:
    """Tell whether a bag is anything but MCAP files as they are."""
    mode = str(metadata.get("compression_mode") or "").lower()
    return metadata.get("storage_identifier", "mcap") != "mcap" or mode not in UNCOMPRESSED


class CopiedBag:
    """A copy in MCAP, which is deleted with this."""

    def __init__(self, folder: Path) -> None:
        """Copy a bag's messages.

        Raises:
            DatasetError: it cannot be read.
        """
        self._place = TemporaryDirectory(prefix="sain_bags-")
        self.file = Path(self._place.name) / "copy" / "copy_0.mcap"
        try:
            _copy(folder, self.file.parent)
        except BaseException:
            self._place.cleanup()
            raise


def _copy(folder: Path, out: Path) -> None:
    try:
        with Reader(folder) as reader, BagWriter(out, BagConfig(compression="none")) as writer:
            for connection in reader.connections:
                writer.add_topic(_topic(connection))
            for connection, time, data in reader.messages(reader.connections):
                writer.write(connection.topic, bytes(data), time)
    except Exception as error:  # of rosbags, of SQLite, or of the system's
        raise DatasetError(
            f"{folder / METADATA_FILE} names a bag that `rosbags` cannot read: {error}"
        ) from error


def _topic(connection: Any) -> Topic:
    definition = connection.msgdef.data if connection.msgdef.format.name == "MSG" else ""
    if not definition:  # recordings of before Iron carry none
        try:
            definition = Definitions().joined(connection.msgtype)
        except InvalidInputError:
            definition = ""
    return Topic(connection.topic, connection.msgtype, definition, connection.digest)
