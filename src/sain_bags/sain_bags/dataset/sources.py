"""The recordings that a data set is made from."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sain_bags.bag.metadata import METADATA_FILE
from sain_bags.dataset.rows import READ
from sain_bags.reading.reader import Bag
from sain_bags.rows.topics import (
    GOAL,
    PUSH,
    PUSH_RESULT,
    SCENE,
    STROKE,
    choose_graph,
    left_out,
    namespaces,
    parent_of,
    topics_of,
)
from sain_core.errors import DatasetError
from sain_core.storage import hash_files

COUNTED: Final = (PUSH, PUSH_RESULT, GOAL, SCENE)


@dataclass(frozen=True)
class Source:
    """The messages of one graph in one recording."""

    bag: Bag
    namespace: str
    sha256: str  # of the MCAP files, one after the other
    counts: dict[str, int]  # messages by type

    @property
    def pushes(self) -> int:
        """How many results of pushes there are to read."""
        return self.counts[PUSH_RESULT]

    @property
    def topics(self) -> tuple[str, ...]:
        """The topics that are read."""
        return topics_of(self.bag, self.namespace, *READ)

    @property
    def has_strokes(self) -> bool:
        """Whether it states the tool's ways."""
        return bool(topics_of(self.bag, self.namespace, STROKE))

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user of its rows should read."""
        notes = [*left_out(self.bag)]
        if (lacking := self.counts[PUSH] - self.pushes) > 0:
            notes.append(f"{lacking:,} pushes have no result, and are no rows")
        if not self.bag.has_crcs:
            notes.append("it has no CRCs: damage inside messages is not detected")
        return tuple(f"{self.bag.path}: {note}" for note in notes)

    @property
    def entry(self) -> dict[str, Any]:
        """Its entry in a card."""
        return {
            "path": str(self.bag.path),
            "sha256": self.sha256,
            "namespace": self.namespace,
            "messages": {name.rpartition("/")[2]: count for name, count in self.counts.items()},
            "custom_data": self.bag.custom_data,
        }


def find_sources(paths: Sequence[Path], namespace: str | None = None) -> tuple[Source, ...]:
    """Open recordings and check that each holds what a row needs.

    Args:
        paths: bags, MCAP files, or folders with bags somewhere below them.
        namespace: of the graph; needed only where a bag holds several.

    Raises:
        DatasetError: no bag, a damaged one, one without the topics that are needed, one that
            holds several graphs where none was chosen, or the same recording twice.
    """
    if not paths:
        raise DatasetError("no recording is given; name bags, MCAP files or folders with bags")
    sources: list[Source] = []
    for path in paths:
        sources += [open_source(bag, namespace) for bag in find_bags(path)]
    seen: dict[str, Path] = {}
    for source in sources:
        if source.sha256 in seen:
            raise DatasetError(
                f"{seen[source.sha256]} and {source.bag.path} are the same recording; give it once"
            )
        seen[source.sha256] = source.bag.path
    with_strokes = [source for source in sources if source.has_strokes]
    if 0 < len(with_strokes) < len(sources):
        raise DatasetError(
            f"{with_strokes[0].bag.path} states the ways of the tool, and another recording does"
            " not; convert them apart"
        )
    return tuple(sources)


def find_bags(path: Path) -> tuple[Path, ...]:
    """Return the path when it is a bag or looks like a broken one, else the bags below it."""
    # Also one that was not closed: it is named in an error, and not passed over.
    marks = (METADATA_FILE, "*.mcap", "*.db3")
    if not path.is_dir() or any(any(path.glob(mark)) for mark in marks):
        return (path,)
    files = [file for mark in marks for file in path.rglob(mark)]
    return tuple(sorted({file.parent for file in files})) or (path,)


def open_source(path: Path, namespace: str | None) -> Source:
    """Open one recording; see `find_sources`."""
    bag = Bag(path)
    found = namespaces(bag, PUSH, PUSH_RESULT) or namespaces(bag)
    chosen = choose_graph(bag, found, namespace)
    counts = dict.fromkeys(sorted(COUNTED), 0)
    for topic in bag.topics:
        if topic.type in counts and parent_of(topic.name) == chosen:
            counts[topic.type] += topic.messages
    if not counts[PUSH_RESULT]:
        raise DatasetError(
            f"{path} holds no pushes to learn from: no {PUSH_RESULT}; it has {_contents(bag)}"
        )
    return Source(bag, chosen, hash_files(bag.files), counts)


def _contents(bag: Bag) -> str:
    held = [f"{one.name} ({one.messages} of {one.type})" for one in bag.topics if one.messages]
    others = {one.channel.message_encoding for one in bag.channels} - {"cdr"}
    why = f"; of these, {', '.join(sorted(others))} is not ROS 2's encoding" if others else ""
    return (", ".join(held) or "no messages at all") + why
