"""Writes the table of columns in docs/reference/formats.md, from `sain_core.transitions`.

./env python tools/columns.py
"""

from __future__ import annotations

from pathlib import Path

from sain_core.transitions import ROUGH, Column

PAGE = Path(__file__).parents[1] / "docs/reference/formats.md"
BEGIN, END = "<!-- columns: made by tools/columns.py -->\n", "<!-- end of columns -->\n"
HEAD = (
    "| column | shape of a row | type | unit | `collect` | `to_dataset` | `real_import` "
    "| meaning |\n"
    "| --- | --- | --- | --- | --- | --- | --- | --- |\n"
)


def page() -> str:
    """Return the page with the table as the schema has it now."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{HEAD}{''.join(map(row, Column))}{families()}\n{END}{after}"


def row(column: Column) -> str:
    """Return a column's line of the table."""
    shape = ", ".join(map(str, column.shape)) or "1"
    cells = (
        f"`{column}`", shape, column.dtype, column.unit, column.collected, column.recorded,
        column.imported, column.meaning,
    )  # fmt: skip
    return f"| {' | '.join(cells)} |\n"


def families() -> str:
    """Return the lines of the columns whose names depend on the world."""
    about = "numbers of a rough world, one column for each ([the worlds](../explanation/worlds.md))"
    return f"| `{ROUGH}*` | the world's | | | where rough | no | no | {about} |\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
