"""Recordings to a data set of transitions, shard by shard.

What is written depends on the recordings and the settings alone: the same command goes on after a
stop, and ends with the same bytes.
"""

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import asdict
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from sain_bags.dataset.card import DatasetCard
from sain_bags.dataset.dataset_folder import DatasetFolder
from sain_bags.dataset.formats.stored_rows import joined
from sain_bags.dataset.rows import BagPart, ConversionConfig, Dropped, RowBlock, read_rows
from sain_bags.dataset.sources import Source, find_sources, open_source
from sain_bags.rows.images import Cameras
from sain_bags.rows.results import stated_outlines
from sain_core.errors import DatasetError
from sain_core.model import Model, load_dynamics
from sain_core.shapes.outlines import write_outlines
from sain_core.transitions import SHARD_SIZE, Column, Columns
from sain_core.wire.images import CAMERAS
from sain_core.workers import Work, WorkerOptions, run_on_workers

WAITING_SHARDS: Final = 2  # that are made and not stored yet
SOFTWARE: Final = (("sain_core", "sain_bags", "sain_model"), ("numpy", "mcap", "numba", "torch"))

ConversionProgress = Callable[[int, int, int], None]  # pushes read, of how many; rows made
Writing = Callable[[int, int], None]  # rows written in a format other than npz, of how many


class Sharding:
    """Numbers rows, and gathers them into shards, each of scenes with one number of disks.

    A simulator that is started anew counts its episodes and scenes from 1 again: where a number
    goes back, another episode has begun. Where scene ids show pushes between two rows,
    steps have a gap, as in a filtered collection.
    """

    def __init__(self) -> None:
        """Begin empty, with episode 0."""
        self.episodes = 0
        self._step = 0
        self._last: tuple[str, int, int] = ("", 0, 0)  # bag, and its numbers
        self._waiting: dict[int, list[Columns]] = {}  # by number of disks

    def add(self, blocks: Sequence[RowBlock], bag: str) -> list[Columns]:
        """Add the next rows of a bag; return the shards that they complete, in that order."""
        full: list[tuple[int, Columns]] = []
        self._number(blocks, bag)
        for block in blocks:
            waiting = self._waiting.setdefault(block.columns[Column.MASSES].shape[1], [])
            before = sum(map(_length, waiting))
            waiting.append(block.columns)
            if before + len(block.places) < SHARD_SIZE:
                continue
            rows = joined(waiting)
            ends = range(SHARD_SIZE, _length(rows) + 1, SHARD_SIZE)
            for end in ends:
                last = int(block.places[end - before - 1])
                full.append((last, _tidy(rows, slice(end - SHARD_SIZE, end))))
            waiting[:] = [{name: column[ends[-1] :] for name, column in rows.items()}]
        return [columns for _, columns in sorted(full, key=lambda shard: shard[0])]

    def rest(self) -> list[Columns]:
        """Return the incomplete shards."""
        left = [joined(waiting) for _, waiting in sorted(self._waiting.items())]
        return [_tidy(rows, slice(None)) for rows in left if _length(rows)]

    def _number(self, blocks: Sequence[RowBlock], bag: str) -> None:
        """Add `episode`, `step` and `bag_sha256` to the next rows."""
        if not blocks:
            return
        order = np.argsort(np.concatenate([block.places for block in blocks]))
        named, scenes = (
            np.concatenate([block.columns[name] for block in blocks])[order].astype(np.int64)
            for name in (Column.BAG_EPISODE, Column.BAG_SCENE)
        )
        episodes, steps = self._count(named, scenes, bag)
        ends = np.cumsum([len(block.places) for block in blocks])
        for block, places in zip(blocks, np.split(np.argsort(order), ends[:-1]), strict=True):
            block.columns[Column.EPISODE] = episodes[places]
            block.columns[Column.STEP] = steps[places]
            block.columns[Column.BAG_SHA256] = np.full(len(places), bag)

    def _count(
        self, episode_ids: np.ndarray, scene_ids: np.ndarray, bag: str
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the episodes and steps of rows (M,) in their order."""
        last_bag, last_episode, last_scene = self._last
        ahead = np.diff(scene_ids, prepend=last_scene)
        goes_on = (np.diff(episode_ids, prepend=last_episode) == 0) & (ahead >= 0)
        goes_on[0] &= bag == last_bag
        walked = self._step + np.cumsum(np.where(goes_on, np.maximum(ahead, 1), 0))
        episodes = self.episodes + np.cumsum(~goes_on) - 1
        begun = np.where(goes_on, 0, walked)  # where the episode of each row began
        steps = walked - np.maximum.accumulate(begun)
        self.episodes, self._step = int(episodes[-1]) + 1, int(steps[-1])
        self._last = (bag, int(episode_ids[-1]), int(scene_ids[-1]))
        return episodes, steps


class Converted(NamedTuple):
    """The result of a conversion."""

    transitions: int
    episodes: int
    dropped: dict[str, int]  # pushes that are no row, by reason
    notes: tuple[str, ...] = ()  # what a user of the rows should read
    left_out: tuple[str, ...] = ()  # the same in words, with the first push of each


def convert(
    paths: Sequence[Path],
    out: Path,
    config: ConversionConfig = ConversionConfig(),
    overwrite: bool = False,
    progress: ConversionProgress = lambda read, messages, rows: None,
    writing: Writing = lambda rows, of: None,
    workers: WorkerOptions = WorkerOptions(),
) -> Converted:
    """Convert recordings, going on where an earlier run of the same conversion stopped.

    Args:
        paths: bags, MCAP files, or folders with bags; rows come in this order.
        out: a new or empty folder, or that of a conversion.
        config: what becomes of them.
        overwrite: make anew what a conversion made there.
        progress: called as pushes are read and shards written.
        writing: called as rows are written in a format other than npz, after all pushes.
        workers: who reads; each of several holds the rows of one recording in memory.

    Raises:
        DatasetError: a recording or an earlier shard is damaged, or holds nothing to learn from.
        ConfigError: no such prior or Ray cluster; the format's library is not installed.
        OutputError: the folder holds something else, or cannot be written.
    """
    sources = find_sources(paths, config.namespace or None)
    cameras = _cameras(sources, config.shown)
    identity = {**asdict(config), "bags": [source.sha256 for source in sources]}
    folder = DatasetFolder(out, identity, overwrite)
    sharding, dropped = Sharding(), list[tuple[Path, Dropped]]()
    card = DatasetCard()
    with closing(_read(sources, config, workers)) as rows:
        for shard in _stored(folder, _shards(sources, rows, sharding, dropped, progress)):
            card.add(shard)
    for bag, push in dropped:
        card.drop(bag, push)
    if not card.transitions:
        why = ", ".join(card.left_out()) or "no push was made"
        raise DatasetError(f"no transition is left: {why}")
    if outlines := [shape for source in sources for shape in stated_outlines(source.bag)]:
        write_outlines(out, outlines)
    made_by = {name: version(name) for name in ("numpy", "mcap")}
    about = {**identity, **made_by, "episodes": sharding.episodes}
    folder.finish(
        card.content(about, [source.entry for source in sources]),
        writing,
        lambda sha256, key, time: cameras[sha256].topics[key].at(time),
    )
    notes = tuple(note for source in sources for note in source.notes)
    counts, left_out = dict(card.dropped), card.left_out()
    return Converted(card.transitions, sharding.episodes, counts, notes, left_out)


def _cameras(sources: Sequence[Source], names: str) -> dict[str, Cameras]:
    """Return the cameras of recordings by their SHA-256; all have the same, or `DatasetError`."""
    found = {one.sha256: Cameras(one.bag, one.namespace, names) for one in sources}
    first = next(iter(found.values())).topics.keys()
    for source in sources:
        if (other := found[source.sha256].topics.keys()) != first:
            held = [", ".join(keys) or "no images" for keys in (first, other)]
            raise DatasetError(
                f"{sources[0].bag.path} has {held[0]}, {source.bag.path} has {held[1]}; convert"
                " them apart, or without images: --images ''"
            )
    return found


class BagJob(NamedTuple):
    """A recording whose rows a worker makes."""

    path: Path
    namespace: str
    sha256: str


class BagRunner:
    """Makes the rows of recordings, here or as the `Runner` of a worker."""

    def __init__(self, config: ConversionConfig) -> None:
        """Store the settings."""
        self._config, self._stack = config, ExitStack()
        self._prior: Model | None = None

    def parts(self, source: Source) -> Iterator[BagPart]:
        """Stream the rows of a recording."""
        return read_rows(source.bag, source.namespace, self._config, self._load)

    def run(self, job: BagJob) -> list[BagPart]:
        """Return all rows of a recording, in memory."""
        source = open_source(job.path, job.namespace)
        if source.sha256 != job.sha256:
            raise DatasetError(
                f"{job.path} is another recording where a worker reads it: its SHA-256 is"
                f" {source.sha256[:12]}, not {job.sha256[:12]}; do not change recordings meanwhile"
            )
        return list(self.parts(source))

    def close(self) -> None:
        """Release the prior."""
        self._stack.close()

    def _load(self) -> Model:
        """Return the prior, which is loaded when one is needed."""
        if self._prior is None:
            self._prior = load_dynamics(self._config.prior)
            self._stack.callback(self._prior.close)
        return self._prior


def _read(
    sources: Sequence[Source], config: ConversionConfig, workers: WorkerOptions
) -> Generator[tuple[Source, BagPart], None, None]:
    """Yield the rows of recordings, in their order, here or on workers: always the same ones."""
    if workers.workers == 1 and not workers.ray:
        with closing(BagRunner(config)) as runner:
            for source in sources:
                for part in runner.parts(source):
                    yield source, part
        return
    jobs = [BagJob(source.bag.path, source.namespace, source.sha256) for source in sources]
    work = Work(partial(BagRunner, config), *SOFTWARE)
    with closing(run_on_workers(work, jobs, workers)) as results:
        for source, parts in zip(sources, results, strict=True):
            for part in parts:
                yield source, part


def _stored(folder: DatasetFolder, shards: Iterable[Columns]) -> Iterator[Columns]:
    """Store shards, also before an error, and yield each then; the next is made meanwhile."""
    with ThreadPoolExecutor(max_workers=1) as writer:
        waiting: deque[Future[Columns]] = deque()
        for shard in shards:
            waiting.append(writer.submit(folder.store, shard))
            while len(waiting) > WAITING_SHARDS:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()


def _shards(
    sources: Sequence[Source],
    rows_of_bags: Iterable[tuple[Source, BagPart]],
    sharding: Sharding,
    dropped: list[tuple[Path, Dropped]],
    progress: ConversionProgress,
) -> Iterator[Columns]:
    """Stream all recordings as shards, and list the pushes that are no rows."""
    pushes = sum(source.pushes for source in sources)
    read = rows = 0
    for source, part in rows_of_bags:
        dropped += [(source.bag.path, push) for push in part.dropped]
        for shard in sharding.add(part.blocks, source.sha256):
            yield shard
            rows += _length(shard)
            progress(read, pushes, rows)
        read += part.pushes
        progress(read, pushes, rows)
    for shard in sharding.rest():
        yield shard
        rows += _length(shard)
        progress(read, pushes, rows)


def _length(columns: Columns) -> int:
    return len(columns[Column.PUSH_ID])


def _tidy(columns: Columns, rows: slice) -> Columns:
    """Return some rows with columns in order, and texts as wide as the longest of them."""
    tidy = {}
    for name in (str(one) for one in Column if one in columns):
        column = columns[name][rows]
        if column.dtype.kind == "U":
            width = max(int(np.strings.str_len(column).max()), 1)
            column = column.astype(f"<U{width}")
        tidy[name] = np.ascontiguousarray(column)
    images = [name for name in columns if name.startswith(CAMERAS)]
    return tidy | {name: np.ascontiguousarray(columns[name][rows]) for name in images}
