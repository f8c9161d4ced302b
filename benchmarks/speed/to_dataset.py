"""How fast bags become data sets, beside bare decoding.

1. A bag of nothing but pushes with their results.
2. A bag of a whole graph at work: the same, and scenes, joints, markers and a clock at 100 Hz.
3. The same messages, each chunk with all topics, as the recorder of `rosbag2` leaves them.

`to_dataset` finds, decodes and checks the messages, computes the SHA-256 of the files, and writes
the shards, safe on the disk. `rosbags` and `mcap-ros2-support-fast` decode the same topics of the
same bag, and nothing else. All on one core, in turns, the shortest time of some. Our recorder gives
pushes chunks of their own, which all readers gain from: the target is against `rosbags` on 3.
"""

import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from benchmarks.report import Figure, ReportOptions, read_options, report
from benchmarks.speed.made_bags import MadeBag
from benchmarks.timing import fastest, one_core
from sain_bags.dataset.conversion import convert
from sain_bags.dataset.sources import find_sources


@dataclass(frozen=True)
class Options(ReportOptions):
    """What to measure."""

    pushes: int = 100_000
    """in the first bag"""
    graph_pushes: int = 2_000
    """in the second"""
    scenes: int = 50
    """between two pushes, in the second"""
    repeats: int = 7
    """of each, of which the fastest counts"""


def with_rosbags(bag: Path, topics: frozenset[str]) -> int:
    """Decode topics with `rosbags`; return how many messages."""
    count = 0
    with AnyReader([bag]) as reader:
        wanted = [found for found in reader.connections if found.topic in topics]
        for connection, _, raw in reader.messages(wanted):
            reader.deserialize(raw, connection.msgtype)
            count += 1
    return count


def with_mcap(bag: Path, topics: frozenset[str]) -> int:
    """Decode topics with `mcap` and `mcap-ros2-support-fast`; return how many messages."""
    from mcap_ros2_support_fast.decoder import DecoderFactory

    (file,) = bag.glob("*.mcap")
    factory: Any = DecoderFactory()  # one of `mcap`'s, though it does not say so
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[factory])
        return sum(1 for _ in reader.iter_decoded_messages(topics))


def with_sain(bag: Path, out: Path) -> int:
    """Convert a bag from the beginning; return how many transitions."""
    shutil.rmtree(out, ignore_errors=True)
    return convert([bag], out).transitions


def speed(name: str, bag: Path, folder: Path, repeats: int, others: Path) -> list[Figure]:
    """Measure one bag; `others` has the same messages as the recorder of `rosbag2` leaves them."""
    (source,) = find_sources([bag])
    topics = frozenset(source.topics)
    messages = sum(topic.messages for topic in source.bag.topics if topic.name in topics)
    works: dict[str, Callable[[], object]] = {
        "to_dataset": partial(with_sain, bag, folder / "out"),
        "rosbags": partial(with_rosbags, bag, topics),
        "mcap-ros2-support-fast": partial(with_mcap, bag, topics),
        "rosbags on rosbag2's bag": partial(with_rosbags, others, topics),
        "to_dataset on rosbag2's bag": partial(with_sain, others, folder / "out"),
    }
    times = fastest(works, repeats)
    rates = {who: 1e-3 * messages / time.wall for who, time in times.items()}
    figures = [Figure(f"{name}: {who}", rate, "k messages/s") for who, rate in rates.items()]
    own, processor = rates["to_dataset"], times["to_dataset"].processor
    for who in list(works)[1:4]:
        ratio = own / rates[who]
        target = 4.0 if who.startswith("rosbags on") else None
        figures.append(Figure(f"{name}: against {who}", ratio, "x", at_least=target))
        ratio = times[who].processor / processor
        figures.append(Figure(f"{name}: against {who}, processor time", ratio, "x"))
    return figures


def make_graph_bag(folder: Path, pushes: int, scenes: int) -> None:
    """Write the bag of a whole graph at work."""
    bag = MadeBag(folder)
    for number in range(pushes):
        bag.pushes(1, first=number + 1)
        bag.scenes(scenes)
    bag.writer.close()


def write_as_rosbag2(bag: Path, folder: Path) -> None:
    """Write the messages of a bag in their order, whatever their topic, into the same chunks."""
    writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with AnyReader([bag]) as reader, writer:
        to = {
            found.id: writer.add_connection(found.topic, found.msgtype, typestore=reader.typestore)
            for found in reader.connections
        }
        for connection, time, raw in reader.messages():
            writer.write(to[connection.id], time, raw)


def main() -> None:
    """Run from the command line."""
    options = read_options(Options, __doc__)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bag = MadeBag(folder / "pushes")
        bag.pushes(options.pushes)
        bag.writer.close()
        make_graph_bag(folder / "graph", options.graph_pushes, options.scenes)
        for title in ("pushes", "graph"):
            write_as_rosbag2(folder / title, folder / f"{title}_rosbag2")
        with one_core():
            figures = [
                figure
                for title in ("pushes", "graph")
                for figure in speed(
                    title, folder / title, folder, options.repeats, folder / f"{title}_rosbag2"
                )
            ]
        report("Bags to data sets, one core", figures, options.out)


if __name__ == "__main__":
    main()
