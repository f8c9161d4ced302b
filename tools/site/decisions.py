"""The list of the decisions."""

import re
from pathlib import Path

INTRODUCTION = """# Decisions

For developers who ask why something is as it is: what was chosen, why, and what follows from it.
Numbers that are missing were replaced by later decisions, or stand in the notebook.

| decision | title |
| ---: | --- |
"""


def pages(root: Path) -> dict[str, str]:
    """Return the page that lists all decisions, the newest first."""
    rows = []
    for path in sorted((root / "docs" / "decisions").glob("[0-9]*.md"), reverse=True):
        title = path.read_text(encoding="utf-8").partition("\n")[0].lstrip("# ")
        title = re.sub(r"^(Decision )?\d+[:.]? *", "", title)
        rows.append(f"| {int(path.name[:4])} | [{title}]({path.name}) |\n")
    return {"decisions/index.md": INTRODUCTION + "".join(rows)}
