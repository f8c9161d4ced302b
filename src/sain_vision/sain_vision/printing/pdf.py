"""A small PDF of filled rectangles and short texts, in millimetres from the lower left corner."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

POINTS: Final = 72 / 25.4  # for each millimetre


@dataclass
class Page:
    """One page of a size [mm]."""

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
