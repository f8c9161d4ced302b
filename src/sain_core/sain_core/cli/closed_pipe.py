"""A reader that has read enough, such as ``| head``, is no error of the command that prints."""

import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def end_with_the_reader() -> Iterator[None]:
    """End the process with exit code 0 where nobody reads standard output any more."""
    try:
        yield
    except BrokenPipeError:
        if not _reader_is_gone():  # it was another pipe
            raise
        raise SystemExit(0) from None
    finally:
        try:
            sys.stdout.flush()
        except BrokenPipeError:  # what is left goes nowhere, also when Python itself ends
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _reader_is_gone() -> bool:
    look = select.poll()
    look.register(sys.stdout.fileno(), 0)
    return any(event & select.POLLERR for _, event in look.poll(0))
