"""Tables as they are read: no number is cut, however narrow the terminal."""

import io
from io import StringIO

import pytest
from rich.console import Console
from rich.text import Text

from sain_core.cli import terminal
from sain_core.cli.terminal import FittingTable, WaitingLine


def shown(width: int, terminal: bool = True) -> str:
    table = FittingTable("Messages of 2 topics in the recording")
    table.add_column("Topic")
    table.add_column("Type")
    for name in ("Messages", "Rate"):
        table.add_column(name, justify="right")
    table.add_row("/sain/scene", Text("sain_interfaces/msg/Scene", "dim"), "1,234,567", "30.0 Hz")
    table.add_row("/clock", "rosgraph_msgs/msg/Clock", "8", "-")
    out = io.StringIO()
    console = Console(file=out, width=width, force_terminal=terminal, color_system=None)
    console.print(table, soft_wrap=True)
    return out.getvalue()


def test_columns_are_aligned_where_they_fit() -> None:
    assert shown(80).splitlines() == [
        "Messages of 2 topics in the recording",
        "Topic        Type                        Messages     Rate",
        "/sain/scene  sain_interfaces/msg/Scene  1,234,567  30.0 Hz",
        "/clock       rosgraph_msgs/msg/Clock            8        -",
    ]


def test_rows_become_pairs_where_they_do_not() -> None:
    assert shown(40).splitlines() == [
        "Messages of 2 topics in the recording",
        "/sain/scene",
        "  Type: sain_interfaces/msg/Scene",
        "  Messages: 1,234,567  Rate: 30.0 Hz",
        "/clock",
        "  Type: rosgraph_msgs/msg/Clock",
        "  Messages: 8  Rate: -",
    ]


@pytest.mark.parametrize("width", range(30, 100))
def test_no_line_is_too_long_and_no_number_is_cut(width: int) -> None:
    text = shown(width)
    assert max(map(len, text.splitlines())) <= max(width, len("  Type: sain_interfaces/msg/Scene"))
    assert "1,234,567" in text and "30.0 Hz" in text and "…" not in text


def test_a_pipe_gets_one_line_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    assert "/sain/scene  sain_interfaces/msg/Scene  1,234,567  30.0 Hz\n" in shown(20, False)


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
