"""Messages of a bag by the thousand, in the order in which they were received.

Chunks, and files, may overlap in time. What was received later than the next chunk begins is held
back until that is read, so that nothing but the overlap has to be kept.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy import ndarray

from sain_bags.mcap.mcap_file import Messages

SPARSE: Final = 4  # times as much data as messages: it is not kept for these few
BATCH_SIZE: Final = 8 << 20  # [bytes], messages are handed on from here
BATCH_STRETCHES: Final = 256  # or with so many read, where little is wanted of each


@dataclass(frozen=True)
class Batch:
    """Messages; entry i of each array is of the i-th."""

    data: ndarray  # (bytes,) uint8
    starts: ndarray  # (M,) where in data the message begins, in CDR with its encapsulation header
    sizes: ndarray  # (M,) [bytes]
    channels: ndarray  # (M,) number of its channel in the bag
    log_times: ndarray  # (M,) [ns since the epoch], received
    publish_times: ndarray  # (M,) [ns since the epoch]
    sequences: ndarray  # (M,) the publisher's count, 0: not known
    ranks: ndarray  # (M,) which stretch of the bag it is from: breaks ties of log times

    def __len__(self) -> int:
        """Return how many messages there are."""
        return len(self.starts)

    def __getitem__(self, index: ndarray) -> "Batch":
        """Return some of the messages, by a mask or by their places."""
        _, *columns = vars(self).values()
        return Batch(self.data, *(column[index] for column in columns))

    def compact(self) -> "Batch":
        """Return the same messages without the data between them."""
        ends = np.cumsum(self.sizes)
        bounds = zip(self.starts.tolist(), (self.starts + self.sizes).tolist(), strict=True)
        parts = [self.data[start:end] for start, end in bounds]
        data = np.concatenate(parts) if parts else self.data[:0]
        return replace(self, data=data, starts=ends - self.sizes)


def make_batch(messages: Messages, channels: ndarray, rank: int) -> Batch:
    """Return the messages of one stretch; `channels` has their numbers in the bag."""
    heads = messages.heads
    batch = Batch(
        messages.data,
        messages.starts,
        heads["length"].astype(np.int64) - 22,
        channels[heads["channel"]],
        heads["log_time"].copy(),
        heads["publish_time"].copy(),
        heads["sequence"].copy(),
        np.full(len(heads), rank),
    )
    sparse = SPARSE * int(batch.sizes.sum()) < len(batch.data)
    return batch.compact() if sparse else batch


def in_order(stretches: Iterable[tuple[int, Batch]]) -> Iterator[Batch]:
    """Sort what comes by the stretch.

    Args:
        stretches: the time before which nothing more will come once the batch is read, and the
            batch; batches in the order in which they begin.
    """
    held: list[Batch] = []
    size = 0
    for limit, batch in stretches:
        held.append(batch)
        size += len(batch.data)
        if size < BATCH_SIZE and len(held) < BATCH_STRETCHES:
            continue
        joined = _sorted(_join(held))
        early = joined.log_times < limit
        if early.all():
            held = []
            yield joined
        else:
            held = [joined[~early].compact()]
            yield joined[early]
        size = sum(len(part.data) for part in held)
    if held:
        yield _sorted(_join(held))


def _join(parts: Sequence[Batch]) -> Batch:
    if len(parts) == 1:
        return parts[0]
    sizes = np.array([len(part.data) for part in parts])
    counts = [len(part) for part in parts]
    shifts = np.repeat(np.cumsum(sizes) - sizes, counts)
    columns = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in Batch.__dataclass_fields__
    }
    columns["starts"] = columns["starts"] + shifts
    return Batch(**columns)


def _sorted(batch: Batch) -> Batch:
    if (np.diff(batch.log_times) > 0).all():
        return batch
    # Within a stretch messages stand in the order of the file, which a stable sort keeps.
    return batch[np.lexsort((batch.ranks, batch.log_times))]
