"""Figures as pages state them: values are read from their page, so that no check drifts from it."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

ROOT: Final = Path(__file__).parents[2]
PAGES: Final = ("README.md", "docs/reference/*.md", "docs/explanation/*.md")
NUMBER: Final = r"(\d[\d,]*(?:\.\d+)?)"
BOUNDED: Final = re.compile(rf"{NUMBER} \[(-?[\d.]+), (-?[\d.]+)\]")
SOLVED: Final = re.compile(r"\**(\d+)/(\d+)\**")
SHARES: Final = ("success", "reached")  # columns
MEASURED: Final = re.compile(  # what makes a cell or a bold text a figure
    rf"{BOUNDED.pattern}|\b\d+/\d+\b|\b\d+ of \d+\b|\d (?:mm|ms|%|s|pushes/s|degrees)\b"
)
BOLD: Final = re.compile(r"\*\*([^*\n]+)\*\*")
COMMAND: Final = re.compile(r"^(?:\./env |make |ros2 run |python -m )|`(?:\./env |make )", re.M)
LINK: Final = re.compile(r"\]\((?!http)[^)#]*?(?:\w+\.md|#[\w-]+)")


class Table(NamedTuple):
    """A table of a page; cells by the first cells of row and column, or their places."""

    page: str
    section: str
    header: list[str]
    rows: list[list[str]]

    @property
    def figures(self) -> int:
        """How many cells state something that was measured."""
        return sum(bool(MEASURED.search(cell)) for row in self.rows for cell in row[1:])


@dataclass(frozen=True)
class Claim:
    """A figure of a page, as stated."""

    page: str  # relative to the checkout
    row: str  # section, row and column, in words
    what: str  # the quantity; `solved` is a share of n
    value: float
    n: int  # that it is of; 0: there are bounds in place of it
    bounds: tuple[float, float] | None = None  # of its 95 % interval; None: not stated
    digit: float = 0.0  # by which its last digit may be rounded


def tables(page: str, root: Path = ROOT) -> Iterator[Table]:
    """Yield the tables of a page, outside of fenced code."""
    section, block = "", list[list[str]]()
    text = re.sub(r"^```.*?^```", "", (root / page).read_text(encoding="utf-8"), flags=re.M | re.S)
    for line in [*text.split("\n"), ""]:
        if line.startswith("|"):
            block.append(
                [cell.strip().replace("\u00a0", " ") for cell in line.strip("|\n ").split("|")]
            )
            continue
        if len(block) > 2:
            yield Table(page, section, block[0], block[2:])
        block = []
        if line.startswith("#"):
            section = line.lstrip("# ").strip("`")


def solved_claims(page: str, root: Path = ROOT) -> dict[tuple[str, str, str, str], list[Claim]]:
    """Return what a page of results states, by scenario, tolerance, model and world."""
    found = {}
    for table in tables(page, root):
        for row in table.rows if table.header[:2] == ["within", "model"] else ():
            for world, cell in zip(table.header[2:], row[2:], strict=True):
                if (solved := SOLVED.search(cell)) and "pushes" in cell:
                    count, n = map(int, solved.groups())
                    where = f"{table.section}, {world}, {row[0]}, {row[1]}"
                    claims = [Claim(page, where, "solved", count / n, n)]
                    for what, of in (("pushes", count), ("s", n), ("mm", n)):
                        if stated := re.search(rf"{NUMBER} {what}\b", cell):
                            claims.append(
                                Claim(page, where, what, float(stated[1]), of, None, 0.05)
                            )
                    found[table.section, row[0], row[1], world] = claims
    return found


def bounded_claims(page: str, section: str, column: str, root: Path = ROOT) -> dict[str, Claim]:
    """Return the figures with intervals in a column of a section's first table, by row."""
    table = next(one for one in tables(page, root) if one.section == section)
    place, found = table.header.index(column), {}
    for row in table.rows:
        if stated := BOUNDED.search(row[place]):
            value, low, high = (float(one.replace(",", "")) for one in stated.groups())
            digit = 0.5 * 10.0 ** -len(stated[1].partition(".")[2])
            where = f"{section}, {row[0]}"
            found[row[0]] = Claim(page, where, column, value, 0, (low, high), digit)
    return found


def share_claims(page: str, root: Path = ROOT) -> dict[tuple[str, str], list[Claim]]:
    """Return shares of successes, and means of seconds beside them, by section and row.

    A share is one cell, such as 19/20, or two, as the columns of faults.
    """
    found = dict[tuple[str, str], list[Claim]]()
    for table in tables(page, root):
        for row in table.rows:
            cells = dict(zip(table.header, row, strict=False))  # empty ones at the end
            pair = (cells.get("Survived"), cells.get("Tries"))
            share = next(
                (cells[name] for name in SHARES if name in cells), "/".join(map(str, pair))
            )
            if solved := SOLVED.fullmatch(share):
                count, n = map(int, solved.groups())
                where = f"{table.section}, {row[0]}"
                claims = [Claim(page, where, "solved", count / n, n)]
                if mean := cells.get("mean [s]"):
                    claims.append(Claim(page, where, "s", float(mean), count, None, 0.05))
                found.setdefault((table.section, row[0]), claims)
    return found


def all_pages(root: Path = ROOT) -> list[str]:
    """Return the pages that may state figures."""
    return [str(one.relative_to(root)) for glob in PAGES for one in sorted(root.glob(glob))]


def without_command(page: str, root: Path = ROOT) -> Iterator[str]:
    """Yield sections with figures in tables or bold that have no command beside them.

    A command stands in fenced or inline code of the section, or before the first section. A link to
    another page or section may stand in its place.
    """
    text = (root / page).read_text(encoding="utf-8")
    first, *sections = re.split(r"^(?=## )", text, flags=re.M)
    for section in (first, *sections):
        title = section.partition("\n")[0].lstrip("# ")
        prose = re.sub(r"^```.*?^```", "", section, flags=re.M | re.S)
        cells = [cell for line in prose.split("\n") if line[:1] == "|" for cell in line.split("|")]
        plain = re.sub(r"^\|.*$", "", prose, flags=re.M)
        figures = [one.strip() for one in (*cells, *BOLD.findall(plain)) if MEASURED.search(one)]
        if figures and not COMMAND.search(first + section) and not LINK.search(prose):
            yield f"{page}, {title}: {len(figures)} figures, the first is {figures[0]}"


def stated_elsewhere(page: str, sources: tuple[str, ...], root: Path = ROOT) -> Iterator[str]:
    """Yield the figures of a page's tables that none of the pages it repeats has."""
    text = "".join((root / one).read_text(encoding="utf-8") for one in sources)
    text = re.sub(r"\*\*|\s\([\d-]+ %\)| pushes", "", text.replace("\u00a0", " "))
    for table in tables(page, root):
        for row in table.rows:
            for cell in row[1:]:
                figure = re.fullmatch(r"(\d+/\d+, [\d.]+)|([\d.]+) mm", cell)
                number = figure and re.escape(figure[1] or figure[2])
                if number and not re.search(rf"(?<![\d.]){number}(?![\d.])", text):
                    where = f"{page}, {table.section}, {row[0]}"
                    yield f"{where}: {cell} is in none of {', '.join(sources)}"
