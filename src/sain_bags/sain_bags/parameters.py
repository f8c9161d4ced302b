"""What a recording tells of a world that its scenes do not show: friction with the table.

The simulator publishes the calls of ``reset_scene`` where its setting ``service_introspection`` is
``contents``, and recorders take them like any topic. A call that asks for a friction (0 leaves it
to the simulator, which does not tell) and its answer, with the new episode's number, say what the
friction of an episode is.
"""

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

from sain_bags.dataset_shards import Columns
from sain_bags.episodes import parent_of
from sain_bags.sources import Source
from sain_core.errors import ErrorCode

RESET: Final = "sain_interfaces/srv/ResetScene_Event"
FRICTION: Final = "friction"  # key of a row, as in a collection; NaN: not known


class KnownFriction:
    """The friction of the episodes that recordings tell of."""

    def __init__(self, sources: Sequence[Source]) -> None:
        """Look for it; what was told twice and differently is not known.

        Raises:
            DatasetError: a recording is damaged.
        """
        self._known: dict[tuple[str, int], float] = {}  # by bag and its number of the episode
        topics = {source.sha256: _topics(source) for source in sources}
        self._told = any(topics.values())
        for source in sources:
            for episode, friction in _resets(source, topics[source.sha256]):
                known = self._known.setdefault((source.sha256, episode), friction)
                if known != friction:
                    self._known[source.sha256, episode] = np.nan

    def added_to(self, columns: Columns) -> Columns:
        """Return columns with the friction of each row; as they are where no recording tells."""
        if not self._told:
            return columns
        places = zip(columns["bag_sha256"].tolist(), columns["bag_episode"].tolist(), strict=True)
        return columns | {FRICTION: np.array([self._known.get(place, np.nan) for place in places])}


def _topics(source: Source) -> tuple[str, ...]:
    return tuple(
        topic.name
        for topic in source.bag.topics
        if topic.type == RESET and parent_of(parent_of(topic.name)) == source.namespace
    )


def _resets(source: Source, topics: tuple[str, ...]) -> Iterator[tuple[int, float]]:
    """Yield the number of each episode whose friction was asked for, and the friction."""
    if not topics:
        return
    decode = _decoder(source)
    asked: dict[tuple[bytes, int], float] = {}  # by caller and number of the call
    for raw in source.bag.raw_messages(topics):
        event = decode(raw.data)
        call = (bytes(event.info.client_gid), event.info.sequence_number)
        for request in event.request:
            asked[call] = request.friction
        for response in event.response:
            if response.error_code == ErrorCode.OK and asked.get(call):
                yield response.scene.episode_id, asked[call]


def _decoder(source: Source) -> Any:
    """Return what decodes the events by the definition in the recording.

    The decoder takes no underscores in names of types, and no types of services.
    """
    with source.bag.file.open("rb") as file:
        summary = make_reader(file).get_summary()
    schemas = summary.schemas.values() if summary else ()
    (found,) = {schema.data: schema for schema in schemas if schema.name == RESET}.values()
    text = found.data.replace(b"ResetScene_", b"ResetScene").replace(b"/srv/", b"/msg/")
    name = RESET.replace("ResetScene_", "ResetScene").replace("/srv/", "/msg/")
    renamed = Schema(id=found.id, name=name, encoding=found.encoding, data=text)
    return DecoderFactory().decoder_for("cdr", renamed)
