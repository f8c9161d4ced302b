"""The files of a bag: one is open; earlier ones are ended in the background."""

from collections.abc import Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor

from sain_bags.bag.metadata import FileSummary, Topic
from sain_bags.writing.split_file import SplitFile


class SplitFiles:
    """Ends files on a thread of its own, so that messages do not wait for the disk."""

    def __init__(self) -> None:
        """Begin without a file."""
        self._files: list[SplitFile] = []
        self._finisher = ThreadPoolExecutor(1, "finisher")
        self._finished: list[Future[None]] = []

    def __len__(self) -> int:
        """Return the number of files."""
        return len(self._files)

    @property
    def size(self) -> int:
        """Size of all files, with what waits to be written [bytes]."""
        return sum(file.size for file in self._files)

    @property
    def summaries(self) -> list[FileSummary]:
        """The entry of each file in ``metadata.yaml``."""
        return [file.summary for file in self._files]

    @property
    def are_whole(self) -> bool:
        """Whether all were ended, and all that is in them can be read."""
        return all(file.whole for file in self._files)

    def counts(self, topics: Iterable[str]) -> dict[str, int]:
        """Return the messages in all files, by topic."""
        counts = dict.fromkeys(topics, 0)
        for file in self._files:
            for name, count in file.counts.items():
                counts[name] += count
        return counts

    def add(self, file: SplitFile) -> None:
        """Add the next file."""
        self._files.append(file)

    def finish_last(self, topics: Iterable[Topic], custom_data: Mapping[str, str]) -> None:
        """Begin to end the file that was added last."""
        file = self._files[-1]
        done = self._finisher.submit(file.finish, tuple(topics), dict(custom_data))
        self._finished.append(done)

    def check(self) -> None:
        """Raise `OSError` when an earlier file could not be ended."""
        for done in self._finished:
            if done.done():
                done.result()

    def close(self) -> list[BaseException]:
        """Wait until all files are ended; return what went wrong."""
        self._finisher.shutdown()
        return [error for done in self._finished if (error := done.exception())]
