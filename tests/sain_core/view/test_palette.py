from dataclasses import fields, replace

import pytest

from sain_core.view.palette import DARK, PALETTE, Palette, rgba

NAMES = [field.name for field in fields(Palette)]


def brightness(colour: str) -> float:
    linear = [c / 12.92 if c < 0.04 else ((c + 0.055) / 1.055) ** 2.4 for c in rgba(colour)[:3]]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("palette", [PALETTE, DARK])
@pytest.mark.parametrize("name", ["ink", "soft", "success", "alarm"])
def test_text_can_be_read_on_paper(palette, name):
    low, high = sorted([brightness(palette.paper), brightness(getattr(palette, name))])
    assert (high + 0.05) / (low + 0.05) > 4.5  # WCAG 2.2, 1.4.3


def test_models_that_are_compared_have_different_colours():
    names = ("physics", "identified", "learned", "predicted", "history", "inside", "floor")
    assert len({getattr(PALETTE, name) for name in names}) == len(names)


def test_the_style_sheet_has_each_colour():
    style = replace(PALETTE, table_edge="#123456").css()
    assert "  --table-edge: #123456;" in style and len(style.splitlines()) == len(NAMES)


def test_shares_of_a_colour():
    assert rgba("#ff0080", 0.5) == pytest.approx((1.0, 0.0, 128 / 255, 0.5))
