"""The images of a recording from which its pushes were chosen: of each camera the last before it.

Which image that is follows from the times in the file's indexes; only these images are unpacked.
"""

from collections.abc import Callable
from io import BytesIO
from typing import Any, Final, TypeVar

import numpy as np
import PIL.Image
from numpy import ndarray
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

from sain_bags.mcap.mcap_file import Batch
from sain_bags.reading.reader import Bag, TopicSummary
from sain_bags.rows.tables import TableReader
from sain_bags.rows.topics import PUSH, namespaces, topics_of
from sain_core.errors import DatasetError, InvalidInputError
from sain_core.transitions import Columns
from sain_core.wire.images import USUAL, Colour, camera_key, decode_colour

RAW, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
JPEG: Final = "/compressed"  # ends the topics of compressed images
DEPTHS: Final = ("16UC1", "32FC1", "mono16", "I", "I;16", "I;16B", "F")  # also modes of Pillow
OLDEST: Final = 1_000_000_000  # [ns], an image before a push: an older one may show another scene
BAD_CONTENT: Final = (
    ValueError, TypeError, LookupError, OSError, PIL.Image.DecompressionBombError,
    InvalidInputError, SerdeError,
)  # fmt: skip
NEVER: Final = -1  # there is no such image

T = TypeVar("T")
_store: Final = get_typestore(Stores.ROS2_JAZZY)


class ImageTopic:
    """The images of one topic."""

    def __init__(self, bag: Bag, topic: TopicSummary) -> None:
        """Read when each was received."""
        self._bag, self._topic = bag, topic
        self._places = bag.places(topic.name)
        self.times = np.array([place.log_time for place in self._places], dtype=np.int64)

    def latest(self, times: ndarray) -> ndarray:
        """Return when the last image before each time (K,) came [ns since the epoch], or `NEVER`.

        It is at most `OLDEST` older.
        """
        found = np.append(self.times, NEVER)[np.searchsorted(self.times, times) - 1]
        return np.where(times - found <= OLDEST, found, NEVER)

    def at(self, time: int) -> Colour:
        """Return the image that was received at this time; raises `DatasetError`."""
        read = _compressed if self._topic.type == COMPRESSED else decode_colour
        return self._read(int(np.searchsorted(self.times, time)), read)

    @property
    def is_coloured(self) -> bool:
        """Whether its first image has colours, or greys; no depths. Raises `DatasetError`."""
        return self._read(0, _encoding) not in DEPTHS

    def _read(self, number: int, read: Callable[[Any], T]) -> T:
        """Return what is read of the image of a number; raises `DatasetError`."""
        try:
            data = self._bag.message_at(self._places[number])
            return read(_store.deserialize_cdr(data, self._topic.type))
        except BAD_CONTENT as error:
            where = f"{self._bag.path}: an image of {self._topic.name}"
            raise DatasetError(f"{where} is not read: {error}") from error


def _encoding(message: Any) -> str:
    """Return how an image is encoded; of one that is compressed, its mode."""
    if hasattr(message, "encoding"):
        return str(message.encoding)
    with PIL.Image.open(BytesIO(message.data.tobytes())) as image:
        return image.mode


def _compressed(message: Any) -> Colour:
    with PIL.Image.open(BytesIO(message.data.tobytes())) as image:
        return np.asarray(image.convert("RGB"))


class Cameras:
    """The cameras of one graph's recording, and when its pushes were sent."""

    def __init__(self, bag: Bag, namespace: str, names: str) -> None:
        """Find the image topics that end in one of some names, with commas between."""
        self.topics = _find(bag, namespace, names)  # by column
        wanted = topics_of(bag, namespace, PUSH) if self.topics else ()
        self._reader = TableReader(bag, wanted, PUSH, ("push_id",))
        self._sent: dict[int, int] = {}  # [ns since the epoch], by push

    def read(self, batch: Batch) -> None:
        """Take when pushes of a batch were sent, whatever else is in it."""
        if len(pushes := self._reader.of(batch)):
            ids = self._reader.read(pushes).columns["push_id"]
            self._sent |= zip(ids.tolist(), pushes.log_times.tolist(), strict=True)

    def columns(self, pushes: ndarray) -> Columns:
        """Return the times of the images before pushes (M,), `NEVER`: there is none."""
        sent = np.array([self._sent.get(push, 0) for push in pushes.tolist()], dtype=np.int64)
        return {key: topic.latest(sent) for key, topic in self.topics.items()}


def _find(bag: Bag, namespace: str, names: str) -> dict[str, ImageTopic]:
    """Return the topics of colour images, by column; of one image in two forms the raw one.

    Raises `DatasetError`: a name that was given is of none, two have one column, or one is not
    read.
    """
    ends = {f"/{name.strip().strip('/')}" for name in names.split(",") if name.strip()}
    others = {f"{other}/" for other in namespaces(bag) if other} - {f"{namespace}/"}
    images = [
        (topic.name.removesuffix(JPEG), topic)
        for topic in sorted(bag.topics, key=lambda one: one.name)  # raw ones come first
        if topic.type in (RAW, COMPRESSED) and topic.messages
        and not topic.name.startswith(tuple(others))
    ]  # fmt: skip
    lacking = [end for end in sorted(ends) if not any(plain.endswith(end) for plain, _ in images)]
    if lacking and names != USUAL:
        has = ", ".join(plain for plain, _ in images) or "none"
        raise DatasetError(f"{bag.path} has no images that end in {lacking[0]}; it has {has}")
    found, plains = dict[str, ImageTopic](), dict[str, str]()
    for plain, topic in images:
        if not plain.endswith(tuple(ends)) or not (one := ImageTopic(bag, topic)).is_coloured:
            continue
        key = camera_key(plain, namespace)
        if plains.setdefault(key, plain) != plain:
            raise DatasetError(
                f"{bag.path}: {plains[key]} and {plain} would both be {key}; name one of them:"
                " --images"
            )
        found.setdefault(key, one)
    return found
