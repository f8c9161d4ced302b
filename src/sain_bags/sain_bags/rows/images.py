"""The images of a recording from which its pushes were chosen: of each camera the last before it.

Which image that is follows from the times in the file's indexes; only these images are unpacked.
"""

from io import BytesIO
from typing import Any, Final

import numpy as np
import PIL.Image
from jaxtyping import UInt8
from numpy import ndarray
from rosbags.typesys import Stores, get_typestore

from sain_bags.mcap.mcap_file import Batch
from sain_bags.reading.reader import Bag, TopicSummary
from sain_bags.rows.tables import TableReader
from sain_bags.rows.topics import PUSH, namespaces, topics_of
from sain_core.errors import DatasetError
from sain_core.transitions import Columns

IMAGES: Final = "observation.images."  # begins the names of columns with times of images
RAW, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
JPEG: Final = "/compressed"  # ends the topics of compressed images
CHANNELS: Final = {"rgb8": (0, 1, 2), "bgr8": (2, 1, 0), "rgba8": (0, 1, 2), "bgra8": (2, 1, 0),
                   "mono8": (0, 0, 0), "8UC1": (0, 0, 0)}  # fmt: skip
SIZES: Final = {"rgba8": 4, "bgra8": 4, "mono8": 1, "8UC1": 1}  # [bytes] of a pixel, by default 3
OLDEST: Final = 1_000_000_000  # [ns], an image before a push: an older one may show another scene
BAD_CONTENT: Final = (
    ValueError, TypeError, LookupError, OSError, PIL.Image.DecompressionBombError, DatasetError,
)  # fmt: skip
NEVER: Final = -1  # there is no such image

Colour = UInt8[ndarray, "height width 3"]
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
        data = self._bag.message_at(self._places[int(np.searchsorted(self.times, time))])
        try:
            message: Any = _store.deserialize_cdr(data, self._topic.type)
            return _compressed(message.data) if self._topic.type == COMPRESSED else _raw(message)
        except BAD_CONTENT as error:
            where = f"{self._bag.path}: an image of {self._topic.name}"
            raise DatasetError(f"{where} is not read: {error}") from error

    @property
    def is_coloured(self) -> bool:
        """Whether its first image has colours, or greys; no depths."""
        if self._topic.type == COMPRESSED:
            return True
        first: Any = _store.deserialize_cdr(self._bag.message_at(self._places[0]), RAW)
        return first.encoding in CHANNELS


def _raw(message: Any) -> Colour:
    height, width, encoding = message.height, message.width, message.encoding
    if encoding not in CHANNELS:
        raise DatasetError(f"its encoding is {encoding!r}; allowed: {', '.join(CHANNELS)}")
    size = SIZES.get(encoding, 3)
    if message.step < width * size or message.data.size != height * message.step:
        raise DatasetError(
            f"{width} x {height} px in {encoding} have {message.data.size} bytes, in rows of"
            f" {message.step}; needed: {height} rows of at least {width * size}"
        )
    pixels = message.data.reshape(height, message.step)[:, : width * size]
    return np.ascontiguousarray(pixels.reshape(height, width, size)[..., CHANNELS[encoding]])


def _compressed(data: ndarray) -> Colour:
    with PIL.Image.open(BytesIO(data.tobytes())) as image:
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
    ends = tuple(f"/{name}" for name in names.split(",") if name)
    others = {f"{other}/" for other in namespaces(bag)} - {f"{namespace}/"}
    found: dict[str, ImageTopic] = {}
    for topic in sorted(bag.topics, key=lambda one: one.name):  # raw ones come first
        plain = topic.name.removesuffix(JPEG)
        is_image = topic.type in (RAW, COMPRESSED) and topic.messages and plain.endswith(ends)
        if not is_image or topic.name.startswith(tuple(others)):
            continue
        end = next(end for end in ends if plain.endswith(end))
        parts = plain.removesuffix(end).removeprefix(namespace).strip("/").split("/")
        images = ImageTopic(bag, topic)
        if images.is_coloured:
            found.setdefault(IMAGES + ("_".join(filter(None, parts)) or "camera"), images)
    return found
