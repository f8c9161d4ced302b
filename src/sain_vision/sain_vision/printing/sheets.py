"""Sheets of tags to cut out, and the board that a camera is calibrated with."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from sain_core.camera.decals import tag_family
from sain_core.errors import ConfigError
from sain_vision.detection import board
from sain_vision.printing.pdf import Page

PAPERS: Final = {"a4": (210.0, 297.0), "a3": (297.0, 420.0), "letter": (215.9, 279.4)}  # [mm]
MARGIN: Final = 10.0  # [mm], that printers leave white
RULER: Final = 100.0  # [mm], long, to check the print with
FOOT: Final = 14.0  # [mm], for the ruler
MODULES: Final = {"36h11": 8, "25h9": 7, "16h5": 6}  # along a side, with the black border
LETTERS: Final = 3.0  # [mm], their height


def draw_tag(page: Page, family: str, number: int, x: float, y: float, size: float) -> None:
    """Draw a tag with its lower left corner at a place, with a side [mm]."""
    black = tag_family(family)[number]
    step = size / len(black)
    for row, modules in enumerate(black):
        bottom = y + size - (row + 1) * step
        start = None
        for column, is_black in enumerate((*modules.tolist(), False)):
            if is_black and start is None:
                start = column
            elif not is_black and start is not None:  # one rectangle, or viewers show seams
                page.rectangle(x + start * step, bottom, (column - start) * step, step)
                start = None


def tag_sheets(family: str, numbers: Sequence[int], size: float, paper: str) -> list[Page]:
    """Return pages with tags of a side [m], with white around them and marks to cut along.

    Raises `ConfigError`: a tag that the family lacks, or that is larger than the paper.
    """
    side = 1000.0 * size
    quiet = side / MODULES[family]
    cell = side + 2 * quiet + LETTERS + 3.0
    width, height = PAPERS[paper]
    columns = int((width - 2 * MARGIN) // cell)
    rows = int((height - 2 * MARGIN - FOOT) // cell)
    if columns < 1 or rows < 1:
        room = min(width, height - FOOT) - 2 * MARGIN - LETTERS - 3.0
        most = room / (1 + 2 / MODULES[family])
        raise ConfigError(f"size is {size:g} m; on {paper} at most {most / 1000:.3f} m has room")
    pages = []
    for first in range(0, len(numbers), columns * rows):
        page = Page(width, height)
        for place, number in enumerate(numbers[first : first + columns * rows]):
            x = MARGIN + place % columns * cell
            y = height - MARGIN - (place // columns + 1) * cell + LETTERS + 3.0
            draw_tag(page, family, number, x + quiet, y + quiet, side)
            _draw_frame(page, x, y, side + 2 * quiet)
            label = f"{family} {number}: {side:g} mm, x ->"  # the direction of its x axis
            letters = min(LETTERS, 1.8 * cell / len(label))
            page.text(x, y - letters - 1.0, letters, label)
        _draw_ruler(page)
        pages.append(page)
    return pages


def board_sheet(paper: str = "a4") -> Page:
    """Return the page of a board; its origin is the board's lower left mark.

    Raises `ConfigError`: it is larger than the paper.
    """
    width, height = PAPERS[paper]
    wide, high = 1000.0 * np.array(board.EXTENT)
    if wide > width - 2 * MARGIN or high > height - 2 * MARGIN - FOOT:
        raise ConfigError(f"the board is {wide:.0f} x {high:.0f} mm; it has no room on {paper}")
    page = Page(width, height)
    left, bottom = MARGIN, MARGIN + FOOT
    for number, corners in board.board_corners().items():
        x, y = 1000.0 * corners.min(axis=0)
        draw_tag(page, board.FAMILY, number, left + x, bottom + y, 1000.0 * board.SIZE)
    page.rectangle(left - 4.0, bottom - 0.1, 8.0, 0.2)
    page.rectangle(left - 0.1, bottom - 4.0, 0.2, 8.0)
    page.text(left + 5.0, bottom - 3.5, LETTERS, "origin; x to the right, y up. Print at 100 %")
    _draw_ruler(page)
    return page


def _draw_frame(page: Page, x: float, y: float, side: float) -> None:
    for dx in (0.0, side):
        for dy in (0.0, side):
            page.rectangle(x + dx - 1.0, y + dy - 0.05, 2.0, 0.1)
            page.rectangle(x + dx - 0.05, y + dy - 1.0, 0.1, 2.0)


def _draw_ruler(page: Page) -> None:
    page.rectangle(MARGIN, MARGIN, RULER, 0.3)
    for end in (0.0, RULER):
        page.rectangle(MARGIN + end - 0.1, MARGIN - 1.5, 0.2, 3.0)
    page.text(MARGIN + RULER + 4.0, MARGIN - 1.0, LETTERS, f"{RULER:g} mm: measure it")
