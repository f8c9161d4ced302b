"""The colours of the pictures."""

from dataclasses import dataclass
from typing import Final

from sain_core.scene import MID, TARGET


@dataclass(frozen=True)
class Palette:
    """The colours of a picture."""

    paper: str = "#ffffff"
    table: str = "#f4f1ea"
    table_edge: str = "#d9d3c5"
    reach: str = "#e6edf2"
    reach_edge: str = "#b4c4d0"
    ink: str = "#2b3036"
    faint: str = "#8a9096"
    mid: str = "#2f6da4"
    target: str = "#e0762f"
    other: str = "#9aa1a8"
    goal: str = "#1f9d61"
    predicted: str = "#7d3fb0"

    def disk(self, index: int) -> str:
        """Return the colour of a disk by its place in the scene."""
        return {MID: self.mid, TARGET: self.target}.get(index, self.other)


PALETTE: Final = Palette()
