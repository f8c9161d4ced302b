"""One sqlite3 file of rosbag2, read as what it is for, and not as any database."""

import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple
from urllib.parse import quote

from sain_bags.bag.definitions import Definitions
from sain_bags.bag.metadata import Topic, read_profiles
from sain_core.errors import InvalidInputError, UntrustedFileError
from sain_core.untrusted import (
    NAME_LENGTH,
    PIECE_BYTES,
    TOPICS,
    limit,
    most_messages,
    refuse_special,
)

TABLES: Final = ("topics", "messages", "message_definitions")
STEPS: Final = 50_000  # of SQLite's machine, between two looks at how many there were
FREE_STEPS: Final = 20_000_000  # for any file, and one for each byte
LARGEST: Final = (1 << 63) - 1  # [ns since the epoch]


class StoredMessage(NamedTuple):
    """One message of a topic."""

    topic: str
    time: int  # [ns since the epoch], received
    data: bytes


class SqliteFile:
    """Use it as a context manager.

    Every method raises `sqlite3.Error` and `UntrustedFileError` where the file is damaged, or
    holds more than is allowed.
    """

    def __init__(self, path: Path) -> None:
        """Open a file, which is not changed."""
        status = path.stat()
        refuse_special(status.st_mode)
        self._size, self._steps = status.st_size, 0
        address = f"file:{quote(str(path.resolve()))}?mode=ro&immutable=1"
        self._base = sqlite3.connect(address, uri=True)
        self._base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, PIECE_BYTES)
        self._base.set_progress_handler(self._is_too_much, STEPS)
        self._base.execute("PRAGMA trusted_schema = OFF")
        self._base.execute("PRAGMA cell_size_check = ON")
        self._columns = self._find_columns()
        self._topics = dict(self._read_topics())

    @property
    def topics(self) -> tuple[Topic, ...]:
        """Its topics, with the profiles that publishers offered."""
        return tuple(self._topics.values())

    def messages(self) -> Iterator[StoredMessage]:
        """Yield all messages in the order in which they were received."""
        places, bytes_read = [], 0
        for row in self._base.execute("SELECT timestamp, rowid, topic_id FROM messages"):
            places.append(row)
            limit("messages", len(places), most_messages(self._size))
        if not all(isinstance(time, int) and 0 <= time <= LARGEST for time, _, _ in places):
            raise UntrustedFileError("the time of a message is no time")
        places.sort()
        for time, number, topic in places:
            found = self._base.execute("SELECT data FROM messages WHERE rowid = ?", (number,))
            (data,) = found.fetchone()
            if not isinstance(data, bytes) or topic not in self._topics:
                raise UntrustedFileError("a message has no bytes, or a topic that is not there")
            bytes_read += len(data)
            limit("bytes of messages, which are more than the file's", bytes_read, self._size)
            yield StoredMessage(self._topics[topic].name, time, data)

    def __enter__(self) -> "SqliteFile":
        """Return the file."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self._base.close()

    def _is_too_much(self) -> bool:
        self._steps += STEPS
        return self._steps > FREE_STEPS + self._size

    def _find_columns(self) -> dict[str, set[str]]:
        """Return the columns of the tables; what only looks like a table is refused."""
        query = f"SELECT name, type, sql FROM sqlite_master WHERE name IN {TABLES}"
        found = self._base.execute(query).fetchall()
        for name, kind, text in found:
            words = str(text).upper()
            if kind != "table" or "VIRTUAL" in words or " AS " in words:
                raise UntrustedFileError(f"{name} is no plain table")
        names = {name for name, _, _ in found}
        if not {"topics", "messages"} <= names:
            raise UntrustedFileError("it has no topics and messages")
        return {
            name: {str(row[1]) for row in self._base.execute(f"PRAGMA table_info({name})")}
            for name in names
        }

    def _read_topics(self) -> Iterator[tuple[int, Topic]]:
        definitions = self._read_definitions()
        optional = ("offered_qos_profiles", "type_description_hash")
        columns = [
            name if name in self._columns["topics"] else "''"
            for name in ("id", "name", "type", *optional)
        ]
        query = f"SELECT {', '.join(columns)} FROM topics LIMIT {TOPICS + 1}"
        rows = self._base.execute(query).fetchall()
        limit("topics", len(rows), TOPICS)
        for number, name, kind, profiles, type_hash in rows:
            if not all(isinstance(value, str) for value in (name, kind, profiles, type_hash)):
                raise UntrustedFileError("a topic has no name or no type")
            limit("characters in a name", max(len(name), len(kind)), NAME_LENGTH)
            definition = definitions[kind] if kind in definitions else _installed(kind)
            yield number, Topic(name, kind, definition, type_hash, read_profiles(profiles))

    def _read_definitions(self) -> dict[str, str]:
        """Return the definitions of types; recordings of before Iron carry none."""
        if "message_definitions" not in self._columns:
            return {}
        query = (
            "SELECT topic_type, encoded_message_definition FROM message_definitions"
            f" WHERE encoding = 'ros2msg' LIMIT {TOPICS + 1}"
        )
        rows: list[tuple[Any, Any]] = self._base.execute(query).fetchall()
        limit("definitions", len(rows), TOPICS)
        return {str(name): text for name, text in rows if isinstance(text, str) and text}


def _installed(kind: str) -> str:
    try:
        return Definitions().joined(kind)
    except InvalidInputError:
        return ""
