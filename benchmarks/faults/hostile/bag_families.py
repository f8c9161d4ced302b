"""Families of hostile bags, by name."""

import shutil
import struct
from pathlib import Path
from typing import Any, Final

from benchmarks.faults.hostile.bags import (
    PUSH,
    Make,
    about_bag,
    database,
    forge,
    mutated,
    nested,
    packed,
    rewritten,
    schema_of,
    special,
    tiny,
    with_file,
    with_metadata,
    with_records,
    zeros,
)
from benchmarks.faults.hostile.documents import (
    BOMB,
    DEEP,
    LARGEST,
    Random,
    change_values,
    documents,
)

MIB: Final = 1 << 20
SMALL: Final = b"a/T[] x\n" + b"=" * 80 + b"\nMSG: a/T\nuint8 v"
RECURSIVE_VIEW: Final = """
CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT);
INSERT INTO topics VALUES(1, '/sain/push', 'sain_interfaces/msg/Push', 'cdr');
"""
MESSAGES: Final = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data);"
ENDLESS: Final = """CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id
+ 1 FROM n) SELECT id, 1 AS topic_id, id AS timestamp, x'00' AS data FROM n;"""


def _metadata(text: str) -> Make:
    wrapped = "\n  ".join(["rosbag2_bagfile_information:", *text.split("\n")])

    def write(good: Path, bad: Path, random: Random) -> None:
        shutil.copytree(good, bad)
        (bad / "metadata.yaml").write_bytes(wrapped.encode(errors="surrogateescape"))

    return write


def _about(**values: Any) -> Make:
    return with_metadata(lambda about, _: about.update(values))


BAGS: Final[dict[str, Make]] = {
    "mutated": mutated,
    "messages mutated": rewritten,
    **{f"metadata: {name}": make for name, make in documents(_metadata).items()},
    "metadata: null topics": _about(topics_with_message_count=None),
    "metadata: wrong kinds": with_metadata(change_values),
    "metadata: missing": _about(custom_data={"missing_messages": DEEP}),
    "metadata: in the file": with_records(lambda _: [about_bag(BOMB)]),
    "metadata: other files": _about(relative_file_paths=["../../../../dev/zero"]),
    "chunk: 4 GB": with_file(lambda _: forge([zeros(64 * MIB)] * 64, messages=64)),
    "chunk: 4 GB of lz4": with_file(lambda _: forge([zeros(256 * MIB, "lz4")] * 16, messages=16)),
    "chunk: 1 GB at once": with_file(lambda _: forge([zeros(1024 * MIB)])),
    "chunk: 2^64 - 1": with_file(lambda _: forge([zeros(4096, claimed=LARGEST)])),
    "chunk: listed often": with_file(lambda _: forge([zeros(16 * MIB)], repeats=2000)),
    "chunk: tiny messages": with_file(lambda _: forge([tiny(50_000)] * 4, messages=7_600_000)),
    "chunk: false count": with_file(lambda _: forge([tiny(50_000)] * 4, messages=4)),
    "schema: 10^6 fields": with_file(
        lambda _: schema_of(b"".join(b"uint8 f%d\n" % n for n in range(10**6)))
    ),
    "schema: recursive": with_file(lambda _: schema_of(f"{PUSH} again".encode())),
    "schema: deep": with_file(lambda _: schema_of(nested(5000))),
    "schema: wide": with_file(lambda _: schema_of(nested(30))),
    "schema: empty": with_file(lambda _: schema_of(b"")),
    "schema: not UTF-8": with_file(lambda _: schema_of(b"uint8 \xff\xfe")),
    "schema: garbage": with_file(lambda random: schema_of(random.bytes(5000))),
    "schema: huge array": with_file(lambda _: schema_of(b"uint8[4000000000] x")),
    "schema: empty arrays": with_file(
        lambda _: schema_of(nested(1, "uint8[0] x").replace(b"a/T0 a", b"a/T0[4000000000] a"))
    ),
    "schema: no name": with_file(lambda _: schema_of(b"uint8 x", suffix="/")),
    "schema: long default": with_file(
        lambda _: schema_of(b"int32[] x [" + b"1," * 400_000 + b"1]")
    ),
    "message: many sequences": with_file(
        lambda _: schema_of(SMALL, struct.pack("<I", 900_000) + bytes(900_000), repeats=7)
    ),
    "message: many fields": with_file(
        lambda _: schema_of(b"".join(b"uint8 f%d\n" % n for n in range(4900)), repeats=1300)
    ),
    "chunk: messages allowed": with_file(lambda _: forge([tiny(240_000)] * 2, messages=480_000)),
    "message: long sequence": with_file(
        lambda _: schema_of(SMALL, struct.pack("<I", 3 * MIB) + bytes(3 * MIB))
    ),
    "message: longer sequence": with_file(
        lambda _: schema_of(SMALL, struct.pack("<I", 7 * MIB) + bytes(7 * MIB))
    ),
    "message: false length": with_file(lambda _: schema_of(b"string x", b"\xff" * 64)),
    "topic: long name": with_file(lambda _: forge([zeros(64)], topic="/" + "x" * MIB)),
    "sqlite3: garbage": database("CREATE TABLE t(x);"),
    "sqlite3: endless view": database(RECURSIVE_VIEW + ENDLESS),
    "sqlite3: other kinds": database(
        RECURSIVE_VIEW + MESSAGES + "INSERT INTO messages VALUES(1, 'x', 'y', 3.5);"
    ),
    "sqlite3: zeros": database(RECURSIVE_VIEW + MESSAGES, rows=1000),
    "sqlite3: large": database(
        RECURSIVE_VIEW + MESSAGES + "INSERT INTO messages VALUES(1, 1, 1, zeroblob(400000000));"
    ),
    "rosbag2: packed files": packed("file", 1024 * MIB),
    "rosbag2: packed messages": packed("message", 1024 * MIB),
    **{
        f"file: {kind}": special(kind, name)
        for kind, name in (
            ("fifo", "*.mcap"), ("zero", "*.mcap"), ("folder", "*.mcap"), ("loop", "*.mcap"),
            ("memory", "*.mcap"),
        )
    },
    "metadata: fifo": special("fifo", "metadata.yaml"),
    "metadata: zero": special("zero", "metadata.yaml"),
}  # fmt: skip
