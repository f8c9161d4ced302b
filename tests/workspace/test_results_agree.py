"""The table of README has the figures of docs/reference/results.md, where both have one."""

import re

import pytest

from tests.paths import ROOT

MODELS = ("straight pushes", "planar prior, history", "SAIN as shipped")  # README's columns
TOLERANCES = ("5 cm", "2 cm", "1 cm", "0.5 cm")
ROW = re.compile(r"^\| \[?`(\w+)`, (\d+)")
FIGURES = re.compile(r"([\d, ]+) \(([\d.]+)\)|([\d, ]+)")
CELL = re.compile(r"\*\*(\d+)/(\d+)\*\* \([^)]*\)(?:, ([\d.]+) pushes)?")

Key = tuple[str, str, str]  # scenario, tolerance, model


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def measured(page: str) -> dict[Key, tuple[int, int, str | None]]:
    """Solved, scenes and pushes in Bullet, as the page of results has them."""
    found = {}
    for section in re.split(r"^## ", page, flags=re.MULTILINE)[1:]:
        lines = [line for line in section.splitlines() if line.startswith("|")]
        if not lines or "Bullet" not in cells(lines[0]):
            continue
        place = cells(lines[0]).index("Bullet")
        for line in lines[2:]:
            row = cells(line)
            if match := CELL.match(row[place]):
                solved, scenes, pushes = match.groups()
                found[section.split("`")[1], row[0], row[1]] = int(solved), int(scenes), pushes
    return found


def claimed(readme: str) -> list[tuple[Key, tuple[int, int, str | None]]]:
    """The same figures in README; the pushes are those of the smallest tolerance."""
    found = []
    for line in readme.splitlines():
        if not (match := ROW.match(line)):
            continue
        for model, cell in zip(MODELS, cells(line)[2:], strict=False):
            if not (figures := FIGURES.fullmatch(cell)) or not cell:
                continue
            solved = [int(number) for number in (figures[1] or figures[3]).split(",")]
            for place, (number, within) in enumerate(zip(solved, TOLERANCES, strict=False)):
                last = figures[2] if place == len(solved) - 1 else None
                found.append(((match[1], within, model), (number, int(match[2]), last)))
    return found


def disagreements(readme: str, page: str) -> tuple[int, list[str]]:
    """How many figures both have, and those of them that differ."""
    results, wrong, common = measured(page), [], 0
    for key, (solved, scenes, pushes) in claimed(readme):
        if key not in results or results[key][1] != scenes:
            continue
        common += 1
        there = results[key]
        if there[0] != solved or (pushes and there[2] != pushes):
            wrong.append(f"{', '.join(key)}: README has {solved} ({pushes}), the page {there}")
    return common, wrong


@pytest.fixture
def pages() -> tuple[str, str]:
    return tuple((ROOT / name).read_text() for name in ("README.md", "docs/reference/results.md"))  # type: ignore[return-value]


def test_readme_has_the_figures_of_the_page_of_results(pages: tuple[str, str]) -> None:
    common, wrong = disagreements(*pages)
    assert wrong == []
    assert common >= 20  # of four scenarios


def test_a_figure_that_differs_is_found(pages: tuple[str, str]) -> None:
    readme, page = pages
    row = next(line for line in readme.splitlines() if line.startswith("| `paper`, 40"))
    for changed in (row.replace("33, 19", "33, 20"), re.sub(r"\([\d.]+\) \|$", "(9.9) |", row)):
        assert len(disagreements(readme.replace(row, changed), page)[1]) == 1


def test_the_papers_table_is_that_of_the_page(pages: tuple[str, str]) -> None:
    readme, page = pages
    assert "| `paper`, 40 scenes: Table I | 40 at 5 cm |" in readme
    assert "| 5 cm | SAIN as shipped | 40/40 (91-100 %) |" in page
