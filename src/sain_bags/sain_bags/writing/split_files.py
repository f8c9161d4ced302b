"""The files of a bag: one is open, and those before it are ended meanwhile."""

from collections.abc import Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor

from sain_bags.bag.metadata import FileSummary, Topic
from sain_bags.writing.split_file import SplitFile


class SplitFiles:
    """Ends files on a thread of its own: the disk may take its time, and messages do not wait."""

    def __init__(self) -> None:
        """Begin without a file."""
        self._parts: list[SplitFile] = []
        self._finisher = ThreadPoolExecutor(1, "finisher")
        self._finished: list[Future[None]] = []

    def __len__(self) -> int:
        """Return the number of files."""
        return len(self._parts)

    @property
    def size(self) -> int:
        """Of all files so far, and of what waits to be written [bytes]."""
        return sum(part.size for part in self._parts)

    @property
    def summaries(self) -> list[FileSummary]:
        """What ``metadata.yaml`` says about each file."""
        return [part.summary for part in self._parts]

    @property
    def are_whole(self) -> bool:
        """Whether all were ended, and all that is in them can be read."""
        return all(part.whole for part in self._parts)

    def counts(self, topics: Iterable[str]) -> dict[str, int]:
        """Return the messages in all files, by topic."""
        counts = dict.fromkeys(topics, 0)
        for part in self._parts:
            for name, count in part.counts.items():
                counts[name] += count
        return counts

    def add(self, part: SplitFile) -> None:
        """Take on the next file."""
        self._parts.append(part)

    def finish_last(self, topics: Iterable[Topic], custom_data: Mapping[str, str]) -> None:
        """Begin to end the file that was added last."""
        part = self._parts[-1]
        done = self._finisher.submit(part.finish, tuple(topics), dict(custom_data))
        self._finished.append(done)

    def check(self) -> None:
        """See whether all files that were to be ended are, or will be.

        Raises:
            OSError: the disk failed.
        """
        for done in self._finished:
            if done.done():
                done.result()

    def close(self) -> list[BaseException]:
        """Wait until all files are ended; return what went wrong."""
        self._finisher.shutdown()
        return [error for done in self._finished if (error := done.exception())]
