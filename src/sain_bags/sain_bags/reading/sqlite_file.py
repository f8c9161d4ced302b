"""One sqlite3 file of rosbag2 as records of MCAP.

Whatever its tables are, SQLite's machine makes no more steps than a file of its size may need, and
no value is larger than a message may be.
"""

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Final
from urllib.parse import quote

from mcap.records import Channel, McapRecord, Message, Schema
from mcap.well_known import MessageEncoding, SchemaEncoding

from sain_bags.bag.definitions import Definitions
from sain_core.errors import InvalidInputError, UntrustedFileError
from sain_core.guarding.untrusted import (
    PIECE_BYTES,
    TOPICS,
    limit,
    most_messages,
    refuse_special,
)

JOURNALS: Final = ("-wal", "-journal")  # behind the name of a file: a killed recorder's messages
STEPS: Final = 50_000  # of SQLite's machine, between two looks at how many there were
FREE_STEPS: Final = 20_000_000  # for any file, and one for each byte
LARGEST: Final = (1 << 63) - 1  # [ns since the epoch]
PLAIN: Final = """
    SELECT count(*) FROM sqlite_master WHERE name IN ('topics', 'messages', 'message_definitions')
    AND (type != 'table' OR upper(sql) LIKE '%VIRTUAL%' OR upper(sql) LIKE '% AS %')
"""
MESSAGES: Final = "SELECT topic_id, timestamp, data FROM messages ORDER BY timestamp"


def read_sqlite(path: Path, place: Path) -> Iterator[McapRecord]:
    """Yield all topics of a file, then its messages by their times.

    Where a journal is beside it, a copy of both is read, in a folder for that.

    Raises:
        UntrustedFileError, ValueError, sqlite3.Error: it is damaged, or holds too much.
    """
    size, options, source = path.stat().st_size, "?mode=ro&immutable=1", path.resolve()
    journals = [ending for ending in JOURNALS if Path(f"{path}{ending}").exists()]
    for ending in ("", *journals):
        refuse_special(Path(f"{path}{ending}").stat().st_mode)
        if journals:
            shutil.copyfile(f"{path}{ending}", place / f"{path.name}{ending}")
            options, source = "", place / path.name
    looks = iter(range((FREE_STEPS + size) // STEPS))
    with closing(sqlite3.connect(f"file:{quote(str(source))}{options}", uri=True)) as base:
        base.row_factory = sqlite3.Row
        base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, PIECE_BYTES)
        base.set_progress_handler(lambda: next(looks, None) is None, STEPS)  # ends it then
        base.execute("PRAGMA trusted_schema = OFF")
        base.execute("PRAGMA cell_size_check = ON")
        if (damage := base.execute("PRAGMA quick_check(1)").fetchone()[0]) != "ok":
            raise UntrustedFileError(f"it is damaged: {damage}")
        if base.execute(PLAIN).fetchone()[0]:
            raise UntrustedFileError("one of its tables is no plain table")
        topics = base.execute("SELECT * FROM topics ORDER BY id").fetchmany(TOPICS + 1)
        limit("topics", len(topics), TOPICS)
        definitions = _definitions(base)
        for number, row in enumerate(topics, start=1):
            topic = {key: row[key] or "" for key in row.keys()}  # noqa: SIM118
            kind = topic["type"]
            text = definitions.get(kind) or _installed(kind)
            hashed = topic.get("type_description_hash", "")
            about = {"topic_type_hash": hashed}
            about["offered_qos_profiles"] = topic.get("offered_qos_profiles", "")
            yield Schema(number, text.encode(), SchemaEncoding.ROS2, kind)
            yield Channel(number, topic["name"], MessageEncoding.CDR, about, number)
        numbers = {row["id"]: number for number, row in enumerate(topics, start=1)}
        for count, (owner, time, data) in enumerate(base.execute(MESSAGES), start=1):
            limit("messages", count, most_messages(size))
            known = isinstance(data, bytes) and isinstance(time, int) and owner in numbers
            if not known or not 0 <= time <= LARGEST:
                raise UntrustedFileError("a message has no bytes, no time, or no topic")
            yield Message(numbers[owner], time, data, time, 0)


def _definitions(base: sqlite3.Connection) -> dict[str, str]:
    """Return the definitions of types in a file; there are none before Iron."""
    try:
        rows = base.execute(
            "SELECT topic_type, encoded_message_definition FROM message_definitions"
            " WHERE encoding = 'ros2msg'"
        )
    except sqlite3.OperationalError:  # there is no such table
        return {}
    return dict(map(tuple, rows.fetchmany(TOPICS)))


def _installed(kind: str) -> str:
    """Return the installed definition of a type, or nothing."""
    try:
        return Definitions().joined(kind)
    except InvalidInputError:
        return ""
