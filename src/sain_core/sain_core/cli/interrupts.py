"""Ctrl-C in a command: at once while nothing is begun, and never inside an import.

Imports may swallow or rewrite a `KeyboardInterrupt`: a bare ``except`` does, and so does compiled
code that goes on without what it could not import.
"""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Timer, current_thread, main_thread
from types import FrameType
from typing import Final

from sain_core.errors import INTERRUPTED

Handler = Callable[[int, FrameType | None], None]

IMPORTS: Final = "<frozen importlib._bootstrap"  # the file of the frames of an import
LOOK_AGAIN: Final = 0.05  # [s] between looks whether an import is over


@contextmanager
def silent_interrupts(active: bool = True) -> Iterator[None]:
    """Let Ctrl-C end the process at once: for what has begun nothing and imports much."""
    with _handled(_end, active):
        yield


@contextmanager
def interrupts_after_imports(active: bool = True) -> Iterator[None]:
    """Let Ctrl-C raise `KeyboardInterrupt`; during an import, as soon as that is over."""
    with _handled(_raise_outside_imports, active):
        yield


@contextmanager
def _handled(handler: Handler, active: bool) -> Iterator[None]:
    if not active or current_thread() is not main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _end(*_: object) -> None:
    os._exit(INTERRUPTED)


def _raise_outside_imports(_: int, frame: FrameType | None) -> None:
    while frame is not None:
        if frame.f_code.co_filename.startswith(IMPORTS):
            # A signal to the main thread, which wakes it also where it waits.
            main = main_thread().ident or 0
            again = Timer(LOOK_AGAIN, signal.pthread_kill, (main, signal.SIGINT))
            again.daemon = True
            again.start()
            return
        frame = frame.f_back
    raise KeyboardInterrupt
