"""Processor time for what is in a file: a small file does not take long."""

import time
from types import TracebackType

from sain_core.errors import UntrustedFileError
from sain_core.untrusted.limits import decoding_seconds


class TimeAllowance:
    """Adds up the processor time that is spent inside it, as a context manager."""

    def __init__(self, size: int) -> None:
        """Begin for a file of this size [bytes]."""
        self._allowed = self._left = decoding_seconds(size)
        self._began = 0.0

    def __enter__(self) -> None:
        """Begin to count."""
        self._began = time.thread_time()

    def __exit__(
        self, kind: type[BaseException] | None, _: BaseException | None, __: TracebackType | None
    ) -> None:
        """Count.

        Raises:
            UntrustedFileError: it was more than is allowed.
        """
        self._left -= time.thread_time() - self._began
        if self._left < 0.0 and kind is None:
            raise UntrustedFileError(
                f"decoding takes more than {self._allowed:.0f} s, too long for its size"
            )
