"""Ctrl-C inside an import that swallows it."""

import os
import signal
import sys
import time
from importlib import import_module
from pathlib import Path

import pytest

from sain_core.cli.command_line import interrupts_after_imports

SWALLOWS = """
import os, signal, time
try:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.1)
except BaseException:
    raise ImportError("rewritten")
WHOLE = True
"""


def test_an_interrupt_inside_an_import_comes_when_that_is_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "swallows_interrupts.py").write_text(SWALLOWS)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt), interrupts_after_imports():
        import_module("swallows_interrupts")
        time.sleep(60)
    assert sys.modules.pop("swallows_interrupts").WHOLE


def test_an_interrupt_elsewhere_comes_at_once() -> None:
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), interrupts_after_imports():
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(60)
    assert signal.getsignal(signal.SIGINT) is before
