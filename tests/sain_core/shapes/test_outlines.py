"""Bodies by their outlines."""

import json
from pathlib import Path

import numpy as np
import pytest

from sain_core.errors import DatasetError
from sain_core.scene import unit
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import get_shape
from sain_core.shapes.outlines import (
    FINEST,
    OUTLINES_FILE,
    Traced,
    convex_parts,
    register_outlines,
    trace,
    write_outlines,
)
from sain_core.shapes.shape import outline_of
from sain_core.shapes.solids import centroid, flat_bottom


def area(ring: np.ndarray) -> float:
    after = np.roll(ring, -1, axis=0)
    return float(0.5 * (ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0]).sum())


def smooth(count: int = 600) -> np.ndarray:
    """An outline with a waist, as a butterfly has."""
    bearing = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
    return (0.06 + 0.02 * np.cos(2 * bearing))[:, None] * unit(bearing) + (0.01, -0.02)


@pytest.mark.parametrize("name", ["t", "star", "u", "ring_segment"])
def test_convex_parts_make_up_the_outline(name: str) -> None:
    outline = get_shape(name).outline(1.0)
    parts = convex_parts(outline)
    assert sum(map(area, parts)) == pytest.approx(area(outline))
    for part in parts:
        here, after = part - np.roll(part, 1, axis=0), np.roll(part, -1, axis=0) - part
        assert (here[:, 0] * after[:, 1] - here[:, 1] * after[:, 0] > -1e-9).all()
    assert 1 < len(parts) <= 4 * len(get_shape(name).parts(1.0))


def test_a_traced_body_is_about_its_centroid() -> None:
    body = trace("butterfly", smooth())
    assert isinstance(body.shape, Traced) and body.shape.name.startswith("butterfly-")
    np.testing.assert_allclose(body.centre, centroid(smooth()), atol=1e-4)
    outline = body.shape.outline(body.radius)
    np.testing.assert_allclose(centroid(outline), 0.0, atol=1e-12)
    assert body.shape.circumradius == pytest.approx(1.0) and not body.shape.is_convex
    assert len(outline) < 150
    away = np.abs(np.hypot(*(outline + body.centre - (0.01, -0.02)).T))
    bearing = np.arctan2(*(outline + body.centre - (0.01, -0.02)).T[::-1])
    assert np.abs(away - 0.06 - 0.02 * np.cos(2 * bearing)).max() < FINEST
    assert outline_of(body.shape).perimeter > 2 * np.pi * 0.6
    assert flat_bottom(body.shape)[1].sum() == pytest.approx(1.0)
    assert len(body.shape.feet) == 3 and Bodies((body.shape,)).pushable == (0,)


def test_outlines_stand_beside_a_data_set(tmp_path: Path) -> None:
    register_outlines(tmp_path)  # there are none
    body = trace("butterfly", smooth())
    write_outlines(tmp_path, [body.shape, get_shape("disk")])
    register_outlines(tmp_path)
    assert get_shape(body.shape.name) == body.shape
    path = tmp_path / OUTLINES_FILE
    good = json.loads(path.read_text())
    for wrong in ([], {"shapes": [1]}, {"shapes": {"a-123456": [[0, 1], [1, 0], [0, 0]]}}, {}):
        path.write_text(json.dumps(wrong))
        with pytest.raises(DatasetError, match=r"outlines\.json is damaged"):
            register_outlines(tmp_path)
    path.write_text(json.dumps(good)[:-9])
    with pytest.raises(DatasetError, match=r"outlines\.json is damaged"):
        register_outlines(tmp_path)
