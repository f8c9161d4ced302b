"""Bags that are hostile: made from a good one, or by hand, for `bag_families`."""

import math
import os
import shutil
import sqlite3
import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import lz4.frame
import yaml
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    Schema,
    Statistics,
)
from mcap.writer import MCAP0_MAGIC

from benchmarks.faults.hostile.documents import Random, mutate
from sain_bags.bag.metadata import Topic
from sain_bags.reading.reader import Bag
from sain_bags.writing.writer import BagConfig, BagWriter

Make = Callable[[Path, Path, Random], object]  # from a good folder, into a folder of the same kind

PUSH: Final = "sain_interfaces/msg/Push"
NAMES: Final = (
    "Push", "Prediction", "PushResult", "Scene", "Goal", "Plan",
    "WorldParameters", "Bodies",
)  # fmt: skip
TYPES: Final = (*(f"sain_interfaces/msg/{name}" for name in NAMES), "sensor_msgs/msg/JointState")
MESSAGE: Final = struct.Struct("<BQHIQQ")
TOPIC: Final = "/sain/topic"


def record(one: McapRecord) -> bytes:
    builder = RecordBuilder()
    one.write(builder)
    return builder.end()


def message(data: bytes, time: int = 1, channel: int = 1) -> bytes:
    return MESSAGE.pack(5, 22 + len(data), channel, 1, time, time) + data


def forge(
    chunks: Sequence[Chunk] = (),
    schemas: Sequence[Schema] = (),
    messages: int = 1,
    repeats: int = 1,
    extra: bytes = b"",
    topic: str = TOPIC,
) -> bytes:
    """Return a file that is whole, with these chunks; each is listed so often."""
    schemas = schemas or [Schema(1, b"uint64 push_id\n", "ros2msg", PUSH)]
    channels = [Channel(one.id, f"{topic}{one.id}", "cdr", {}, one.id) for one in schemas]
    described = b"".join(map(record, [*schemas, *channels]))
    content = bytearray(MCAP0_MAGIC + record(Header("ros2", "forged")) + described + extra)
    indexes = b""
    for chunk in chunks:
        packed = record(chunk)
        index = ChunkIndex(
            len(packed), len(content), chunk.compression, len(chunk.data), 9, 0, {}, 1,
            chunk.uncompressed_size,
        )  # fmt: skip
        indexes += record(index) * repeats
        content += packed
    content += record(DataEnd(0))
    start = len(content)
    count = Statistics(0, len(schemas), {}, len(chunks), messages, 10, 0, 1, 1)
    content += described + record(count) + indexes
    return bytes(content + record(Footer(start, 0, 0)) + MCAP0_MAGIC)


def zeros(size: int, compression: str = "zstd", claimed: int | None = None) -> Chunk:
    """Return a chunk of one message of zeros."""
    data = message(bytes(size - MESSAGE.size))
    pack = zstandard.ZstdCompressor().compress if compression == "zstd" else lz4.frame.compress
    return Chunk(compression, pack(data), 9, 1, 0, size if claimed is None else claimed)


def tiny(count: int) -> Chunk:
    """Return a chunk of so many empty messages."""
    data = message(b"") * count
    return Chunk("zstd", zstandard.ZstdCompressor().compress(data), 9, 1, 0, len(data))


def schema_of(text: bytes, data: bytes = bytes(4096), suffix: str = "", repeats: int = 1) -> bytes:
    """Return a file in which all types of the graph have this definition."""
    names = (f"{name}{suffix}" if suffix else name for name in TYPES)
    schemas = [Schema(n, text, "ros2msg", name) for n, name in enumerate(names, 1)]
    content = b"".join(message(b"\0\1\0\0" + data, one.id, one.id) for one in schemas) * repeats
    pack = zstandard.ZstdCompressor().compress
    chunk = Chunk("zstd", pack(content), 9, 1, 0, len(content))
    return forge([chunk], schemas, messages=len(schemas) * repeats)


def rewritten(good: Path, bad: Path, random: Random) -> None:
    """Write a good bag again with some messages or definitions mutated, and with right CRCs."""
    bag = Bag(good)
    with BagWriter(bad, BagConfig(min_free_space=0)) as writer:
        for found in bag.channels:
            assert found.schema is not None
            text = found.schema.data
            text = mutate(text, random) if random.random() < 0.1 else text
            writer.add_topic(Topic(found.topic, found.type, text.decode(errors="replace")))
        for raw in bag.raw_messages():
            chance, data, time = random.random(), raw.data, raw.log_time
            if chance < 0.05:
                data = mutate(data, random)
            elif chance < 0.08:
                data = _with_number(data, random)
            elif chance < 0.09:
                time = int(random.integers(1 << 63))
            writer.write(raw.topic, data, time)


def _with_number(data: bytes, random: Random) -> bytes:
    """Put a special number in the place of one, or a large length."""
    place = 4 * int(random.integers(1, max(len(data) // 4, 2)))
    numbers = (math.nan, math.inf, 1e300, -1e300, 0.0, -1.0, 1e-300)
    packed = struct.pack("<d", numbers[int(random.integers(len(numbers)))])
    return data[:place] + packed + data[place + 8 :]


def nested(depth: int, end: str = "uint8 x") -> bytes:
    """Return a definition of types inside each other, twice each."""
    parts = ["a/T0 a\na/T0 b"]
    for level in range(depth):
        inner = f"a/T{level + 1} a\na/T{level + 1} b" if level + 1 < depth else end
        parts.append(f"{'=' * 80}\nMSG: a/T{level}\n{inner}")
    return "\n".join(parts).encode()


def the_file(folder: Path) -> Path:
    return next(folder.glob("*.mcap"))


def with_file(make: Callable[[Random], bytes]) -> Make:
    """Return what puts another file into a good bag."""

    def write(good: Path, bad: Path, random: Random) -> None:
        shutil.copytree(good, bad)
        the_file(bad).write_bytes(make(random))

    return write


def with_metadata(change: Callable[[dict[str, Any], Random], object]) -> Make:
    """Return what changes values of ``metadata.yaml``, or replaces its text."""

    def write(good: Path, bad: Path, random: Random) -> None:
        shutil.copytree(good, bad)
        path = bad / "metadata.yaml"
        content = yaml.safe_load(path.read_text())
        changed = change(content["rosbag2_bagfile_information"], random)
        path.write_text(changed if isinstance(changed, str) else yaml.safe_dump(content))

    return write


def mutated(good: Path, bad: Path, random: Random) -> None:
    """Flip, cut or insert bytes; or put the largest length where one may stand."""
    shutil.copytree(good, bad)
    name = the_file(bad) if random.random() < 0.8 else bad / "metadata.yaml"
    name.write_bytes(mutate(name.read_bytes(), random))


def special(kind: str, name: str) -> Make:
    """Return what puts a FIFO, a device or a folder in the place of a file; see `put_special`."""

    def write(good: Path, bad: Path, _: Random) -> None:
        shutil.copytree(good, bad)
        put_special(kind, next(bad.glob(name)))

    return write


def put_special(kind: str, path: Path) -> None:
    path.unlink(missing_ok=True)
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to({"zero": "/dev/zero", "loop": path.name, "memory": "/proc/kcore"}[kind])


def database(script: str, rows: int = 0) -> Make:
    """Return what makes a sqlite3 bag of a script, with messages of zeros."""

    def write(good: Path, bad: Path, _: Random) -> None:
        def describe(about: dict[str, Any], _: Random) -> None:
            about.update(storage_identifier="sqlite3", relative_file_paths=["bag.db3"])

        with_metadata(describe)(good, bad, _)
        base = sqlite3.connect(bad / "bag.db3")
        base.executescript(script)
        if rows:
            base.executemany("INSERT INTO messages VALUES(?, 1, ?, ?)", _rows(rows))
        base.commit()
        base.close()

    return write


def _rows(count: int) -> list[tuple[int, int, bytes]]:
    return [(number + 1, number, bytes(16)) for number in range(count)]


def packed(mode: str, size: int) -> Make:
    """Return what makes a bag that rosbag2 compressed, of zeros."""

    def write(good: Path, bad: Path, random: Random) -> None:
        def describe(about: dict[str, Any], _: Random) -> None:
            about.update(compression_mode=mode, compression_format="zstd")
            about["relative_file_paths"] = [f"bag.mcap{'.zstd' if mode == 'file' else ''}"]

        with_metadata(describe)(good, bad, random)
        content = compressed_zeros(size)
        if mode == "message":
            chunk = Chunk("", message(content), 9, 1, 0, len(message(content)))
            content = forge([chunk])
        (bad / f"bag.mcap{'.zstd' if mode == 'file' else ''}").write_bytes(content)

    return write


def compressed_zeros(size: int) -> bytes:
    """Return one zstd frame, which states its size."""
    packer = zstandard.ZstdCompressor().compressobj(size=size)
    piece = bytes(min(size, 1 << 24))
    parts = [packer.compress(piece) for _ in range(size // len(piece))]
    return b"".join([*parts, packer.flush()])


def with_records(make: Callable[[Random], Sequence[McapRecord]]) -> Make:
    return with_file(lambda random: forge([zeros(64)], extra=b"".join(map(record, make(random)))))


def about_bag(text: str) -> Metadata:
    """Return the record that rosbag2 writes into a file, with this text."""
    return Metadata("rosbag2", {"serialized_metadata": text})
