"""Sheets of tags to cut out, and the board that calibrates a camera, as PDF in true size."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from sain_core.camera.decals import tag_family
from sain_core.errors import ConfigError
from sain_vision.detection.calibration import BOARD_FAMILY, EXTENT, SIZE, board_corners

PAPERS: Final = {"a4": (210.0, 297.0), "a3": (297.0, 420.0), "letter": (215.9, 279.4)}  # [mm]
MARGIN: Final = 10.0  # [mm], that printers leave white
RULER: Final = 100.0  # [mm], long, to check the print with
FOOT: Final = 14.0  # [mm], for the ruler
MODULES: Final = {"36h11": 8, "25h9": 7, "16h5": 6}  # along a side, with the black border
LETTERS: Final = 3.0  # [mm], their height
POINTS: Final = 72 / 25.4  # for each millimetre


@dataclass
class Page:
    """One page of a size [mm], with places from its lower left corner on."""

    width: float
    height: float
    marks: list[str] = field(default_factory=list)

    def rectangle(self, x: float, y: float, width: float, height: float) -> None:
        """Fill a rectangle with black."""
        numbers = " ".join(f"{POINTS * value:.4f}" for value in (x, y, width, height))
        self.marks.append(f"{numbers} re f")

    def text(self, x: float, y: float, size: float, text: str) -> None:
        """Write a text from a place on, with letters of a size [mm]."""
        safe = "".join(letter for letter in text if letter.isascii() and letter not in "()\\")
        place = f"{POINTS * x:.4f} {POINTS * y:.4f} Td"
        self.marks.append(f"BT /F1 {POINTS * size:.2f} Tf {place} ({safe}) Tj ET")


def pdf_of(pages: Sequence[Page]) -> bytes:
    """Return the bytes of a PDF."""
    count = len(pages)
    kids = " ".join(f"{4 + 2 * number} 0 R" for number in range(count))
    objects = [
        "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
        f"<< /Type /Pages /Kids [{kids}] /Count {count} >>",
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    for number, page in enumerate(pages):
        box = f"[0 0 {POINTS * page.width:.4f} {POINTS * page.height:.4f}]"
        objects.append(
            f"<< /Type /Page /Parent 2 0 R /MediaBox {box} /Contents {5 + 2 * number} 0 R"
            " /Resources << /Font << /F1 3 0 R >> >> >>"
        )
        content = "\n".join(page.marks)
        objects.append(f"<< /Length {len(content)} >>\nstream\n{content}\nendstream")
    text, places = "%PDF-1.4\n", []
    for number, one in enumerate(objects, start=1):
        places.append(len(text))
        text += f"{number} 0 obj\n{one}\nendobj\n"
    start = len(text)
    rows = "".join(f"{place:010d} 00000 n \n" for place in places)
    text += f"xref\n0 {len(objects) + 1}\n0000000000 65535 f \n{rows}"
    text += f"trailer\n<< /Size {len(objects) + 1} /Root 1 0 R >>\nstartxref\n{start}\n%%EOF\n"
    return text.encode("ascii")


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
    wide, high = 1000.0 * np.array(EXTENT)
    if wide > width - 2 * MARGIN or high > height - 2 * MARGIN - FOOT:
        raise ConfigError(f"the board is {wide:.0f} x {high:.0f} mm; it has no room on {paper}")
    page = Page(width, height)
    left, bottom = MARGIN, MARGIN + FOOT
    for number, corners in board_corners().items():
        x, y = 1000.0 * corners.min(axis=0)
        draw_tag(page, BOARD_FAMILY, number, left + x, bottom + y, 1000.0 * SIZE)
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
