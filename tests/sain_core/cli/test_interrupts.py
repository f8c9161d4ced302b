"""Ctrl-C inside an import that swallows it."""

import os
import signal
import subprocess
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


def test_an_interrupt_while_a_command_imports_ends_it_at_once(tmp_path: Path) -> None:
    (tmp_path / "slow_import.py").write_text(
        "import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\ntime.sleep(60)"
    )
    (tmp_path / "main.py").write_text(
        "from sain_core.cli.command_line import interrupts_after_imports\n"
        "def work():\n    import slow_import\n"
        "with interrupts_after_imports(work=work):\n    work()"
    )
    done = subprocess.run([sys.executable, tmp_path / "main.py"], capture_output=True, timeout=30)
    assert (done.returncode, done.stderr) == (130, b"")
