"""The messages of a chunk in the order of their log times: they are taken topic by topic."""

from collections.abc import Mapping
from itertools import pairwise


def in_log_order(
    messages: bytes, places: Mapping[int, list[int]]
) -> tuple[bytes, dict[int, list[int]]]:
    """Return messages in the order of their log times, and their places.

    Args:
        messages: records, one after the other.
        places: by channel: log time, offset, log time, ... of the messages.
    """
    found = [
        (time, offset, channel)
        for channel, index in places.items()
        for time, offset in zip(index[::2], index[1::2], strict=True)
    ]
    ends = dict(pairwise([*sorted(offset for _, offset, _ in found), len(messages)]))
    ordered: dict[int, list[int]] = {channel: [] for channel in places}
    parts, place = [], 0
    for time, offset, channel in sorted(found):  # messages of the same time stay as they are
        ordered[channel] += (time, place)
        parts.append(messages[offset : ends[offset]])
        place += ends[offset] - offset
    return b"".join(parts), ordered
