"""The rows of recordings, one recording after another or on workers: always the same ones."""

from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

from sain_bags.rows.dropped import Dropped
from sain_bags.rows.latched import Latched, Read
from sain_bags.rows.results import read_results
from sain_bags.rows.rows import RowBlock, RowMaker, RowsConfig
from sain_bags.rows.sources import Source, open_source
from sain_core.errors import DatasetError
from sain_core.model import Model, load_dynamics
from sain_core.workers import Software, Work, WorkerOptions, run_on_workers

SOFTWARE: Final = Software(
    ("sain_core", "sain_bags", "sain_model"), ("numpy", "mcap", "numba", "torch")
)


class BagPart(NamedTuple):
    """Rows of some pushes of a recording."""

    pushes: int  # that were read for them
    blocks: list[RowBlock]
    dropped: list[Dropped]


class BagRows:
    """Makes rows of recordings; a prior is loaded when one is needed."""

    def __init__(self, config: RowsConfig) -> None:
        """Store the settings."""
        self._stack, self._config = ExitStack(), config
        self._prior: Model | None = None

    def _load(self) -> Model:
        if self._prior is None:
            self._prior = load_dynamics(self._config.prior)
            self._stack.callback(self._prior.close)
        return self._prior

    def parts(self, source: Source, read: Read) -> Iterator[BagPart]:
        """Stream the rows of a recording, of which a part was read."""
        maker = RowMaker(self._config, read.latched, self._load)
        for results in read_results(source.bag, source.namespace, read.results):
            yield BagPart(len(results), *maker.rows(results))

    def close(self) -> None:
        """Release the prior."""
        self._stack.close()


class BagJob(NamedTuple):
    """A recording whose rows a worker makes."""

    path: Path
    namespace: str
    sha256: str
    latched: Latched


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
        return list(self.parts(source, Read(job.latched, None)))


def rows_of(
    sources: Sequence[Source],
    read: Sequence[Read],
    config: RowsConfig,
    workers: WorkerOptions,
) -> Generator[tuple[Source, BagPart], None, None]:
    """Yield the rows of recordings, in their order; each has its goals, bodies and worlds."""
    if workers.workers == 1 and not workers.ray:
        with closing(BagRows(config)) as rows:
            for source, known in zip(sources, read, strict=True):
                for part in rows.parts(source, known):
                    yield source, part
        return
    jobs = [
        BagJob(source.bag.path, source.namespace, source.sha256, known.latched)
        for source, known in zip(sources, read, strict=True)
    ]
    work = Work(partial(BagRunner, config), SOFTWARE)
    with closing(run_on_workers(work, jobs, workers)) as results:
        for source, parts in zip(sources, results, strict=True):
            for part in parts:
                yield source, part
