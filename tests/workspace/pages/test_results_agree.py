"""The figures of README are those of the pages that they are taken from."""

import re
from collections.abc import Iterator

from tests.paths import ROOT

README = ROOT / "README.md"
RESULTS, REAL = "docs/reference/results.md", "docs/reference/real.md"
COLUMN = {"9,000 of them": "all", "300 of them": "300"}
Table = dict[str, dict[str, str]]


def figures(readme: str) -> Iterator[list[str]]:
    """Where, what the network learned from, and the figures of physics and of SAIN."""
    for line in readme.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 4 and re.match(r"\d", cells[-1]):
            yield cells


def table(page: str, heading: str) -> Table:
    """The first table below a heading: its rows by their first cell, their cells by column."""
    section = re.split(rf"^#+ {heading}\n", (ROOT / page).read_text(), flags=re.MULTILINE)[1]
    lines = re.findall(r"^\|.*\|$", section.partition("\n#")[0], re.MULTILINE)
    head, _, *rows = (
        [cell.strip().replace("\xa0", " ") for cell in line[1:-1].split("|")] for line in lines
    )
    return {row[0]: dict(zip(head, row, strict=True)) for row in rows}


def measured(where: str, learned: str) -> tuple[str, str]:
    """What the pages have there: the figures of physics and of SAIN."""
    if where == "real pushes":
        rows = table(REAL, "By number of training pushes")
        both = (rows[name][COLUMN[learned]] for name in ("physics, identified", "SAIN"))
        physics, sain = (f"{cell.partition(',')[0]} mm" for cell in both)
        return physics, sain
    row = table(RESULTS, where)["`anywhere`"]
    assert row["within"] == "0.5 cm"
    return row["planar prior, history"], row["SAIN as shipped"]


def test_readme_has_the_figures_of_the_pages():
    stated = list(figures(README.read_text()))
    assert len(stated) == 6
    for where, learned, physics, sain in stated:
        assert (physics, sain) == measured(where, learned), where


def test_the_papers_figure_is_that_of_the_page_of_results():
    page = (ROOT / RESULTS).read_text()
    row = next(line for line in page.splitlines() if line.startswith("| `paper` |"))
    assert "40 of 40 `paper` scenes to 5 cm" in " ".join(README.read_text().split())
    assert row.split(" | ")[2].startswith("40/40")
