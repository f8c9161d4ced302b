"""One sqlite3 file of rosbag2: read by rosbags, after a look at what it holds."""

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Final
from urllib.parse import quote

from mcap.records import Channel, McapRecord, Message, Schema
from mcap.well_known import MessageEncoding, SchemaEncoding
from rosbags.interfaces import ConnectionExtRosbag2, MessageDefinitionFormat
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from sain_bags.bag.definitions import Definitions
from sain_bags.bag.metadata import Topic, as_topic_qos
from sain_core.errors import InvalidInputError, UntrustedFileError
from sain_core.guarding.documents import YAML_BYTES
from sain_core.guarding.untrusted import (
    NAME_LENGTH,
    PIECE_BYTES,
    SUMMARY_BYTES,
    TOPICS,
    limit,
    most_messages,
    refuse_special,
)

JOURNALS: Final = ("-wal", "-journal")  # behind the name of a file
STEPS: Final = 50_000  # of SQLite's machine, between two looks at how many there were
FREE_STEPS: Final = 20_000_000  # for any file, and one for each byte
LARGEST: Final = (1 << 63) - 1  # [ns since the epoch]
PLAIN: Final = """
    SELECT count(*) FROM sqlite_master WHERE name IN ('topics', 'messages', 'message_definitions')
    AND (type != 'table' OR upper(sql) LIKE '%VIRTUAL%' OR upper(sql) LIKE '% AS %')
"""
TOPIC_SIZES: Final = "SELECT count(*), max(max(length(name), length(type))) FROM topics"
MESSAGE_SIZES: Final = f"""
    SELECT count(*), total(length(data)), max(length(data)),
        total(typeof(data) != 'blob' OR typeof(timestamp) != 'integer'
            OR timestamp NOT BETWEEN 0 AND {LARGEST} OR topic_id NOT IN (SELECT id FROM topics))
    FROM messages
"""


def whole_sqlite(path: Path, place: Path) -> Path:
    """Return a file, or its copy with what its writer had left beside it: a journal.

    A recorder that was killed, or still records, has its latest messages there.
    """
    beside = [Path(f"{path}{ending}") for ending in JOURNALS]
    beside = [file for file in beside if file.exists() and file.stat().st_size]
    if not beside:
        return path
    for file in (path, *beside):
        refuse_special(file.stat().st_mode)
        shutil.copyfile(file, place / file.name)
    with closing(sqlite3.connect(place / path.name)) as base:
        base.execute("PRAGMA journal_mode = DELETE")  # moves all from the journal into the file
        base.execute("SELECT count(*) FROM sqlite_master")
    return place / path.name


def read_sqlite(path: Path) -> Iterator[McapRecord]:
    """Yield all topics of a file, then its messages by their times, as records of MCAP."""
    check_sqlite(path)
    reader = Sqlite3Reader(Path(quote(str(path.resolve()))))  # it makes a URI of it
    reader.open()
    try:
        for number, one in enumerate(reader.connections, start=1):
            assert isinstance(one.ext, ConnectionExtRosbag2)
            is_described = one.msgdef.format == MessageDefinitionFormat.MSG and one.msgdef.data
            definition = one.msgdef.data if is_described else _installed(one.msgtype)
            profiles = tuple(map(as_topic_qos, one.ext.offered_qos_profiles))
            about = Topic(one.topic, one.msgtype, definition, one.digest, profiles).about
            yield Schema(number, definition.encode(), SchemaEncoding.ROS2, one.msgtype)
            yield Channel(number, one.topic, MessageEncoding.CDR, about, number)
        numbers = {one.id: number for number, one in enumerate(reader.connections, start=1)}
        for connection, time, data in reader.messages(reader.connections):
            yield Message(numbers[connection.id], time, data, time, 0)
    finally:
        reader.close()


def check_sqlite(path: Path) -> None:
    """Check that a file is a bag, and holds no more than a file of its size may."""
    status = path.stat()
    refuse_special(status.st_mode)
    base = sqlite3.connect(f"file:{quote(str(path.resolve()))}?mode=ro&immutable=1", uri=True)
    try:
        base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, PIECE_BYTES)
        looks = iter(range((FREE_STEPS + status.st_size) // STEPS))
        base.set_progress_handler(lambda: next(looks, None) is None, STEPS)  # ends it then
        base.execute("PRAGMA trusted_schema = OFF")
        base.execute("PRAGMA cell_size_check = ON")
        if (damage := base.execute("PRAGMA quick_check(1)").fetchone()[0]) != "ok":
            raise UntrustedFileError(f"it is damaged: {damage}")
        if base.execute(PLAIN).fetchone()[0]:
            raise UntrustedFileError("one of its tables is no plain table")
        _check_topics(base)
        count, total, longest, wrong = base.execute(MESSAGE_SIZES).fetchone()
    finally:
        base.close()
    if wrong:
        raise UntrustedFileError("a message has no bytes, no time, or a topic that is not there")
    limit("messages", count, most_messages(status.st_size))
    limit("bytes of messages, which are more than the file's", int(total), status.st_size)
    limit("bytes in a message", longest or 0, PIECE_BYTES)


def _check_topics(base: sqlite3.Connection) -> None:
    count, longest = base.execute(TOPIC_SIZES).fetchone()
    limit("topics", count, TOPICS)
    limit("characters in a name", longest or 0, NAME_LENGTH)
    for table, text, most in (
        ("topics", "offered_qos_profiles", YAML_BYTES),
        ("message_definitions", "encoded_message_definition", SUMMARY_BYTES),
    ):
        if text in {row[1] for row in base.execute(f"PRAGMA table_info({table})")}:
            query = f"SELECT count(*), total(length({text})) FROM {table}"
            count, size = base.execute(query).fetchone()
            limit(f"rows in {table}", count, TOPICS)
            limit(f"characters in {text}", int(size), most)


def _installed(kind: str) -> str:
    """Return the installed definition of a type; recordings of before Iron carry none."""
    try:
        return Definitions().joined(kind)
    except InvalidInputError:
        return ""
