"""The rows of recordings, one recording after another or on workers: always the same ones."""

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

from sain_bags.transitions.dropped import Dropped
from sain_bags.transitions.messages import MessageReader
from sain_bags.transitions.pairing import Pairing
from sain_bags.transitions.rows import EpisodeBodies, RowBlock, RowMaker
from sain_bags.transitions.sources import Source, open_source
from sain_core.errors import DatasetError
from sain_core.model import Model, load_dynamics
from sain_core.workers import Software, Work, WorkerOptions, run_on_workers

SOFTWARE: Final = Software(
    ("sain_core", "sain_bags", "sain_model"), ("numpy", "mcap", "numba", "torch")
)


class RowsConfig(NamedTuple):
    """What becomes of pushes."""

    prior: str
    moved_only: bool
    keep_unsettled: bool


class BagPart(NamedTuple):
    """Rows of some messages of a recording."""

    messages: int  # that were read for them
    rows: list[tuple[list[RowBlock], list[Dropped]]]
    late_predictions: int = 0


class BagRows:
    """Makes rows of recordings; a prior is loaded when one is needed."""

    def __init__(self, config: RowsConfig) -> None:
        """Store the settings."""
        self._stack, self._config = ExitStack(), config
        self._maker = RowMaker(self._load, *config)

    def _load(self) -> Model:
        dynamics = load_dynamics(self._config.prior)
        self._stack.callback(dynamics.close)
        return dynamics

    def parts(self, source: Source, bodies: EpisodeBodies) -> Iterator[BagPart]:
        """Stream the rows of a recording whose episodes have these bodies."""
        pairing = Pairing(source.has_results, source.has_predictions)
        reader = MessageReader(source.bag.channels, source.bag.decoding)
        for batch in source.bag.batches(source.topics):
            with naming(source.bag.path):
                pairing.read(reader.read(batch), len(batch))
            yield BagPart(len(batch), [self._maker.rows(one, bodies) for one in pairing.ready()])
        rest = [self._maker.rows(one, bodies) for one in pairing.rest()]
        yield BagPart(0, rest, pairing.late_predictions)

    def close(self) -> None:
        """Release the prior."""
        self._stack.close()


class BagJob(NamedTuple):
    """A recording whose rows a worker makes."""

    path: Path
    namespace: str
    sha256: str
    bodies: EpisodeBodies


class BagRunner(BagRows):
    """The `Runner` of a worker. It holds the rows of one recording in memory."""

    def run(self, job: BagJob) -> list[BagPart]:
        """Return all rows of a recording.

        Raises:
            DatasetError: the recording is damaged, or is not the one that was meant.
        """
        source = open_source(job.path, job.namespace)
        if source.sha256 != job.sha256:
            raise DatasetError(
                f"{job.path} is another recording where a worker reads it: its SHA-256 is"
                f" {source.sha256[:12]}, not {job.sha256[:12]}; do not change recordings meanwhile"
            )
        return list(self.parts(source, job.bodies))


def rows_of(
    sources: Sequence[Source],
    bodies_of: Callable[[str], EpisodeBodies],
    config: RowsConfig,
    workers: WorkerOptions,
) -> Generator[tuple[Source, BagPart], None, None]:
    """Yield the rows of recordings, in their order.

    `bodies_of` returns, for the SHA-256 of a recording, what tells the bodies of its episodes.
    """
    if workers.workers == 1 and not workers.ray:
        with closing(BagRows(config)) as rows:
            for source in sources:
                for part in rows.parts(source, bodies_of(source.sha256)):
                    yield source, part
        return
    jobs = [
        BagJob(source.bag.path, source.namespace, source.sha256, bodies_of(source.sha256))
        for source in sources
    ]
    work = Work(partial(BagRunner, config), SOFTWARE, lambda job: str(job.path))
    with closing(run_on_workers(work, jobs, workers)) as results:
        for source, parts in zip(sources, results, strict=True):
            for part in parts:
                yield source, part


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Name the bag in the error when a message in it is not as it should be."""
    try:
        yield
    except DatasetError as error:
        raise DatasetError(
            f"{path} holds messages of another definition than this graph's: {error}"
        ) from error
