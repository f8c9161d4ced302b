"""Tables as they are read: no number is cut, however narrow the terminal."""

import io

from rich.console import Console
from rich.text import Text

from sain_core.cli.terminal import FittingTable


def shown(width: int, terminal: bool = True) -> str:
    title, names = "Messages of 2 topics in the recording", ("Topic", "Type", "Messages", "Rate")
    table = FittingTable(names, left=names[:2], title=title)
    table.add_row("/sain/scene", Text("sain_interfaces/msg/Scene", "dim"), "1,234,567", "30.0 Hz")
    table.add_row("/clock", "rosgraph_msgs/msg/Clock", "8", "-")
    out = io.StringIO()
    console = Console(file=out, width=width, force_terminal=terminal, color_system=None)
    console.print(table, soft_wrap=True)
    return out.getvalue()


def test_columns_are_aligned_where_they_fit():
    assert shown(80).splitlines() == [
        "Messages of 2 topics in the recording",
        "Topic        Type                        Messages     Rate",
        "/sain/scene  sain_interfaces/msg/Scene  1,234,567  30.0 Hz",
        "/clock       rosgraph_msgs/msg/Clock            8        -",
    ]


def test_rows_become_pairs_where_they_do_not():
    assert shown(40).splitlines() == [
        "Messages of 2 topics in the recording",
        "/sain/scene",
        "  Type: sain_interfaces/msg/Scene",
        "  Messages: 1,234,567  Rate: 30.0 Hz",
        "/clock",
        "  Type: rosgraph_msgs/msg/Clock",
        "  Messages: 8  Rate: -",
    ]
