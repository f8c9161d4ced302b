from dataclasses import fields

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
