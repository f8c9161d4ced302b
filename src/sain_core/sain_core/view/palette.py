"""The colours of every picture, of the report page and of the rendered world, by their meaning."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Final

Rgba = tuple[float, float, float, float]


@dataclass(frozen=True)
class Palette:
    """One colour for each thing that is drawn, as ``#rrggbb``; these are the colours on white."""

    page: str = "#f7f6f3"  # behind the cards of a page
    paper: str = "#ffffff"
    ink: str = "#2b3036"
    soft: str = "#626a72"  # of text that explains
    line: str = "#e5e2db"
    table: str = "#f4f1ea"
    table_edge: str = "#d9d3c5"
    reach: str = "#e6edf2"
    reach_edge: str = "#b4c4d0"
    mid: str = "#2f6da4"
    target: str = "#e0762f"
    other: str = "#9aa1a8"
    goal: str = "#1f9d61"
    success: str = "#17794a"  # of text
    alarm: str = "#b3382c"
    physics: str = "#8a9096"  # what a model predicted, from here on, in the order of legends
    identified: str = "#b09a3e"
    learned: str = "#c9912b"
    predicted: str = "#7d3fb0"  # by the planner's model, and by SAIN wherever models are compared
    history: str = "#be185d"  # SAIN with the pushes before
    inside: str = "#1e3a8a"  # SAIN inside physics
    region: str = "#dea820"  # where a body should be after a push
    floor: str = "#2b3036"

    def named(self, name: str) -> str:
        """Return the colour of this name."""
        return str(getattr(self, name))

    def css(self) -> str:
        """Return the declarations of a style sheet, one ``--name: colour;`` for each."""
        names = [
            (field.name.replace("_", "-"), getattr(self, field.name)) for field in fields(self)
        ]
        return "\n".join(f"  --{name}: {colour};" for name, colour in names)


BODIES: Final = (  # names of the colours of bodies, by their places in the scene
    "mid", "target", "history", "inside", "learned", "alarm", "identified", "physics", "soft",
    "ink",
)  # fmt: skip
PALETTE: Final = Palette()
DARK: Final = Palette(
    page="#131518",
    paper="#1b1e22",
    ink="#e4e7ea",
    soft="#a0a8b0",
    line="#2e3339",
    table="#25241f",
    table_edge="#454136",
    reach="#202a32",
    reach_edge="#475a69",
    mid="#68a5db",
    target="#f0935a",
    other="#858d95",
    goal="#3cc084",
    success="#55cf98",
    alarm="#f08576",
    physics="#9aa1a8",
    predicted="#bb8dea",
)


def rgba(colour: str, alpha: float = 1.0) -> Rgba:
    """Return a colour ``#rrggbb`` as shares of red, green, blue and opacity, from 0 to 1."""
    red, green, blue = (int(colour[place : place + 2], 16) / 255 for place in (1, 3, 5))
    return red, green, blue, alpha


def body_colours(own: Sequence[bool]) -> list[str]:
    """Return the names of the colours of bodies: of their own, or the one of all others."""
    return [BODIES[body % len(BODIES)] if mine else "other" for body, mine in enumerate(own)]


def cost_colour(share: float) -> str:
    """Return a colour from that of the cheapest (0) over the middle to that of the dearest (1)."""
    stops = (PALETTE.goal, PALETTE.learned, PALETTE.alarm)
    first = min(int(2 * share), 1)
    ends, along = zip(rgba(stops[first]), rgba(stops[first + 1]), strict=True), 2 * share - first
    red, green, blue, _ = (round(255 * (low + along * (high - low))) for low, high in ends)
    return f"#{red:02x}{green:02x}{blue:02x}"
