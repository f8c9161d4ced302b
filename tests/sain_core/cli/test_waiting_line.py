"""What a person reads while a command waits."""

from io import StringIO

import pytest
from rich.console import Console

from sain_core.cli import terminal
from sain_core.cli.terminal import WaitingLine


def test_without_a_terminal_lines_come_at_times_and_say_something_new(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = [100.0]
    monkeypatch.setattr(terminal.time, "monotonic", lambda: clock[-1])
    console = Console(file=StringIO(), width=40)
    line = WaitingLine(console, patience_s=1.0)
    line.say("nobody waits yet")
    with line:
        for seconds, text in (
            (100.9, "too early to mention"),
            (101.0, "compiling 1 of 40 kernels [bold]"),
            (104.0, "compiling 2 of 40 kernels"),
            (106.0, "compiling 31 of 40 kernels"),
            (112.0, "compiling 31 of 40 kernels"),
            (113.0, ""),
        ):
            clock.append(seconds)
            line.say(text)
    clock.append(200.0)
    line.say("nobody waits any more")
    assert isinstance(console.file, StringIO)
    assert console.file.getvalue() == (
        "compiling 1 of 40 kernels [bold]\ncompiling 31 of 40 kernels\n"
    )


def test_in_a_terminal_the_line_moves_and_is_gone_at_the_end() -> None:
    console = Console(file=StringIO(), width=60, force_terminal=True)
    with WaitingLine(console) as line:
        line.say("compiling 31 of 40 [kernels]")
    assert isinstance(console.file, StringIO)
    shown = console.file.getvalue()
    assert "compiling 31 of 40 [kernels]" in shown
    assert shown.endswith("\x1b[2K")  # cleared
