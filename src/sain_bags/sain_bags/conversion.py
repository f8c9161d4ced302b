"""Recordings to a data set of transitions, shard by shard.

What is written depends on the recordings and the settings alone: the same command goes on after a
stop, and ends with the same bytes.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

from sain_bags.card import Card
from sain_bags.dataset_folder import DatasetFolder
from sain_bags.dataset_shards import Numbered, columns
from sain_bags.formats import FormatName
from sain_bags.pairing import Paired, Pairing
from sain_bags.parameters import KnownFriction
from sain_bags.rows import Dropped, Row, RowMaker
from sain_bags.sources import Source, find_sources
from sain_core.dynamics import Dynamics
from sain_core.errors import DatasetError
from sain_core.plugins import load_dynamics
from sain_core.shards import SHARD_SIZE

Progress = Callable[[int, int, int], None]  # messages read, of how many; rows made
Writing = Callable[[int, int], None]  # rows written in a format other than npz, of how many


@dataclass(frozen=True)
class ConversionConfig:
    """What becomes of recordings."""

    format: FormatName = "npz"
    """Of the data set (docs/formats.md); npz: shards of 1,000 with the keys of `collect`'s."""
    prior: str = "planar"
    """Predicts the pushes that a recording has no prediction of: a name, or a checkpoint's path."""
    moved_only: bool = False
    """Keep only transitions whose target moved by 2 mm or more, as the paper does."""
    keep_unsettled: bool = False
    """Keep also pushes before or after which something still moved."""
    namespace: str = ""
    """Of the graph, for example /sain; needed where a recording holds several."""


class Converted(NamedTuple):
    """What a conversion has made."""

    transitions: int
    episodes: int
    dropped: dict[str, int]  # pushes that are no row, by reason


class Numbering:
    """Counts episodes over all recordings, and the steps of each.

    A simulator that is started anew counts its episodes and scenes from 1 again: where a number
    goes back, another episode has begun. Where scene ids tell of pushes between two rows, steps
    leave a gap, as they do in a collection that was filtered.
    """

    def __init__(self) -> None:
        """Begin with episode 0."""
        self.episodes = 0
        self._step = 0
        self._last: tuple[str, int, int] = ("", 0, 0)  # bag, and its numbers

    def number(self, row: Row, bag: str) -> Numbered:
        """Return the next row with its episode and its step in it."""
        last_bag, last_episode, last_scene = self._last
        goes_on = (bag, row.episode_id) == (last_bag, last_episode) and row.scene_id >= last_scene
        self._step = self._step + max(row.scene_id - last_scene, 1) if goes_on else 0
        self.episodes += not goes_on
        self._last = (bag, row.episode_id, row.scene_id)
        return Numbered(row, self.episodes - 1, self._step, bag)


def convert(
    paths: Sequence[Path],
    out: Path,
    config: ConversionConfig = ConversionConfig(),
    overwrite: bool = False,
    progress: Progress = lambda read, messages, rows: None,
    writing: Writing = lambda rows, of: None,
) -> Converted:
    """Convert recordings, going on where an earlier run of the same conversion stopped.

    Args:
        paths: bags, MCAP files, or folders with bags below them; rows come in this order.
        out: a new or empty folder, or that of a conversion.
        config: what becomes of them.
        overwrite: make anew what a conversion made there.
        progress: called after each message.
        writing: called as rows are written in a format other than npz, after all messages.

    Raises:
        DatasetError: a recording is no bag, is damaged, or holds nothing to learn from; a shard
            of an earlier run is damaged.
        ConfigError: there is no such prior, or the format's library is not installed.
        OutputError: the folder holds something else, or cannot be written.
    """
    sources = find_sources(paths, config.namespace or None)
    identity = {**asdict(config), "bags": [source.sha256 for source in sources]}
    folder = DatasetFolder(out, identity, overwrite)
    card, numbering, friction = Card(), Numbering(), KnownFriction(sources)
    with ExitStack() as stack:

        def prior() -> Dynamics:
            dynamics = load_dynamics(config.prior)
            stack.callback(getattr(dynamics, "close", lambda: None))
            return dynamics

        maker = RowMaker(prior, config.prior, config.moved_only, config.keep_unsettled)
        for rows in _shards(_rows(sources, maker, numbering, card, progress)):
            card.add(folder.store(friction.added_to(columns(rows))))
    if not card.transitions:
        raise DatasetError(f"no transition is left: {card.why_none()}")
    about = {**identity, **_versions(), "episodes": numbering.episodes}
    folder.finish(card.content(about, [source.describe() for source in sources]), writing)
    return Converted(card.transitions, numbering.episodes, dict(card.dropped))


def _rows(
    sources: Sequence[Source],
    maker: RowMaker,
    numbering: Numbering,
    card: Card,
    progress: Progress,
) -> Iterator[Numbered]:
    """Stream all recordings as rows, and count on the card what is dropped."""
    counter = _Counter(sum(source.messages for source in sources), progress)
    for source in sources:
        for row in _outcomes(source, maker, card, counter):
            if isinstance(row, Dropped):
                card.drop(source.bag.path, row)
            else:
                counter.rows += 1
                yield numbering.number(row, source.sha256)


def _outcomes(
    source: Source, maker: RowMaker, card: Card, counter: "_Counter"
) -> Iterator[Row | Dropped]:
    """Stream what became of the pushes of one recording."""
    try:
        for paired in _pushes(source, card, counter):
            yield maker.row(paired)
    except AttributeError as error:  # a message without a field that is asked of it
        raise DatasetError(
            f"{source.bag.path} holds messages of another definition than this graph's: {error}"
        ) from error


def _pushes(source: Source, card: Card, counter: "_Counter") -> Iterator[Paired]:
    """Stream the pushes of one recording."""
    pairing = Pairing(source.has_results, source.has_predictions)
    for received in source.bag.messages(source.topics):
        yield from pairing.add(received)
        counter.read_one()
    yield from pairing.rest()
    card.late_predictions += pairing.late_predictions


def _shards(rows: Iterator[Numbered]) -> Iterator[list[Numbered]]:
    """Gather rows into shards, each of scenes with one number of disks."""
    waiting: dict[int, list[Numbered]] = {}
    for numbered in rows:
        disks = len(numbered.row.state)
        waiting.setdefault(disks, []).append(numbered)
        if len(waiting[disks]) == SHARD_SIZE:
            yield waiting.pop(disks)
    yield from (waiting[disks] for disks in sorted(waiting))


def _versions() -> dict[str, str]:
    return {name: version(name) for name in ("numpy", "mcap", "mcap-ros2-support")}


class _Counter:
    """Tells how far the reading has come."""

    def __init__(self, messages: int, progress: Progress) -> None:
        self.rows, self._read = 0, 0
        self._messages, self._progress = messages, progress

    def read_one(self) -> None:
        self._read += 1
        self._progress(self._read, self._messages, self.rows)
