"""The figures of README are those of the pages that they link to."""

import re
from collections.abc import Iterator

from tests.paths import ROOT

README = ROOT / "README.md"
ROW = re.compile(
    r"^\| \[.*?\]\((?P<page>docs/[^)#]+)#(?P<heading>[^)]+)\).* \| (?P<value>\d[^|]*) \|$"
)


def figures(readme: str) -> Iterator[tuple[str, str, str]]:
    """Page, heading and value of each figure, as README states them."""
    for line in readme.splitlines():
        if found := ROW.match(line):
            yield found["page"], found["heading"], found["value"]


def section(page: str, heading: str) -> str:
    """What a page has below a heading, named as GitHub does."""
    for part in re.split(r"^#+ ", page, flags=re.MULTILINE):
        title = part.partition("\n")[0].strip().lower()
        if re.sub(r"[^\w\- ]", "", title).replace(" ", "-") == heading:
            return part
    raise AssertionError(f"no heading {heading}")


def missing(readme: str) -> list[str]:
    """The figures that do not stand where README says."""
    return [
        f"{value}: not in {page}#{heading}"
        for page, heading, value in figures(readme)
        if not stands(value, section((ROOT / page).read_text(), heading))
    ]


def stands(value: str, text: str) -> bool:
    """Whether a figure is in a text: solved scenes of SAIN, or a number with its unit or none."""
    if " of " in value:
        row = r"^\| 0\.5\scm \| SAIN as shipped \| \*\*" + value.replace(" of ", "/") + r"\*\*"
        return re.search(row, text, re.MULTILINE) is not None
    number, unit = value.split()
    cells = (f"| **{number}** [", f"| {number} {unit} |")  # of SAIN; of a table with units
    return any(cell in text for cell in cells)


def test_readme_has_the_figures_of_the_pages() -> None:
    readme = README.read_text()
    assert len(list(figures(readme))) == 3
    assert missing(readme) == []


def test_the_papers_figure_is_that_of_the_page_of_results() -> None:
    page = (ROOT / "docs/reference/results.md").read_text()
    row = next(line for line in page.splitlines() if line.startswith("| `paper` |"))
    assert "40 of 40 `paper` scenes to 5 cm" in " ".join(README.read_text().split())
    assert row.split(" | ")[2].startswith("40/40")
