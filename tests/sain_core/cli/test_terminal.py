"""Tables as they are read: no number is cut, however narrow the terminal."""

import io

import pytest
from rich.console import Console

from sain_core.cli.terminal import FittingTable

NAMES = ("Topic", "Type", "Messages", "Rate")
ROW = ("/sain/scene", "sain_interfaces/msg/[Scene]", "1,234,567", "30.0 Hz")


@pytest.mark.parametrize(("width", "terminal"), [(80, True), (45, True), (8, True), (8, False)])
def test_a_number_is_never_cut_and_a_text_is_folded_or_whole(width, terminal, monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)  # of the shell of whoever tests
    table = FittingTable(NAMES, left=NAMES[:2], title="Messages of a topic")
    table.add_row(*ROW)
    out = io.StringIO()
    console = Console(file=out, width=width, force_terminal=terminal, color_system=None)
    console.print(table, soft_wrap=True)
    title, header, *lines = out.getvalue().splitlines()
    assert (title, header.split()) == ("Messages of a topic", list(NAMES))
    assert lines[0].endswith("  1,234,567  30.0 Hz") and len(lines[0]) == len(header)
    assert "".join(line[13 : len(header) - 20].strip() for line in lines) == ROW[1]
    if width == 80 or not terminal:
        assert lines == ["/sain/scene  sain_interfaces/msg/[Scene]  1,234,567  30.0 Hz"]
