"""Where a camera is, from looks at a board: exact where they are good, else refused."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import ConfigError, InvalidInputError
from sain_vision.detection.calibration import Look, board_corners, calibrate, match_board
from sain_vision.detection.planar_fit import turned
from sain_vision.detection.tags import TagConfig, TagFinder
from sain_vision.optics import CameraModel
from sain_vision.printing import board_sheet, pdf_of, tag_sheets
from sain_vision.ros.calibrate_camera import CalibrateOptions
from tests.sain_vision.pictures import CAMERA

CORNERS = board_corners()
FIRST = np.array([0.3, -0.1, 0.2])
WITHOUT_POSE = CAMERA.moved(np.eye(3), np.zeros(3))
NOISE = np.random.default_rng(0).uniform(0, 700, (4 * len(CORNERS), 2))


def looks(
    camera: CameraModel = CAMERA,
    stretch: float = 1.0,
    spread: float = 1.0,
    noise: float = 0.05,
) -> list[Look]:
    """Return looks at a board, printed larger than it should be by a factor."""
    random = np.random.default_rng(0)
    points = np.concatenate(list(CORNERS.values()))
    spots = np.array([(x, y, 0.0) for x in (0.2, 0.45) for y in (-0.35, -0.1, 0.15, 0.1, 0.3)])
    made = []
    for number in range(10):
        pose = FIRST + spread * (spots[number % len(spots)] - FIRST) if number else FIRST
        places = stretch * turned(points, float(pose[2])) + pose[:2]
        pixels = camera.project(np.column_stack([places, np.zeros(len(places))]))
        made.append(Look(points, pixels + noise * random.standard_normal(pixels.shape)))
    return made


def test_the_camera_is_found_where_it_is():
    lens = np.array([-0.1, 0.03, 0.001, -0.001, 0.0])
    camera = replace(CAMERA, distortion=lens)
    made = calibrate(replace(WITHOUT_POSE, distortion=lens), looks(camera), FIRST)
    np.testing.assert_allclose(made.camera.place, CAMERA.place, atol=0.001)
    pixels = np.array([(200.0, 200.0), (1000.0, 600.0), (640.0, 360.0)])
    off = made.camera.on_plane(pixels, 0.04) - camera.on_plane(pixels, 0.04)
    assert np.abs(off).max() < 0.0005
    assert made.error < 0.2 and np.abs(made.bias).max() < 0.1


@pytest.mark.parametrize(
    ("given", "first", "message"),
    [
        (looks(spread=0.0), FIRST, "the looks span .* lay the board near all corners"),
        (looks(noise=3.0), FIRST, r"places on the table are off by .* mm \(p95\); at most 1 mm"),
        ([Look(one.points[:8], one.pixels[:8]) for one in looks()], FIRST, "look 1 shows 2 tags"),
        (
            [Look(looks()[0].points, NOISE), *looks()[1:]], FIRST,
            "look 2 shows the board where, after the first look, no table is: the board must",
        ),
        (looks(), np.array([300.0, 0, 0]), "the calibrated camera shows no point of the table"),
    ],
    ids=["alike", "noise", "tags", "first", "origin"],
)  # fmt: skip
def test_a_bad_calibration_is_refused(given, first, message):
    with pytest.raises(InvalidInputError, match=message):
        calibrate(WITHOUT_POSE, given, first)


@pytest.mark.parametrize(
    ("origin", "text"),
    [
        ((400.0, 0.0, 0.0), r"origin is \(400, 0\) m; it must be in x"),
        ((0.4, 0.0, 90.0), "turn is 90.0; .* 90 degrees are 1.571 rad"),
    ],
)  # fmt: skip
def test_an_origin_off_the_table_is_refused_before_the_looks(origin, text):
    with pytest.raises(ConfigError, match=text):
        CalibrateOptions(origin=origin)


def rendered(page, scale: float = 4.0) -> np.ndarray:
    """Return a picture of a page, so many pixels for a millimetre."""
    picture = np.full((round(scale * page.height), round(scale * page.width)), 255, np.uint8)
    for mark in page.marks:
        if mark.endswith("re f"):
            x, y, w, h = (float(one) * 25.4 / 72 * scale for one in mark.split()[:4])
            top = len(picture) - (y + h)
            picture[round(top) : round(top + h), round(x) : round(x + w)] = 0
    return picture


def test_the_printed_board_is_the_one_that_is_looked_for():
    scale = 4.0
    picture = rendered(board_sheet(), scale)
    found = TagFinder(TagConfig()).find(picture)
    assert set(found) == set(CORNERS)
    points, pixels = match_board(found)
    places = np.column_stack([pixels[:, 0] + 0.5, len(picture) - pixels[:, 1] - 0.5]) / scale
    off = places - 1000 * points
    assert np.abs(off - off.mean(axis=0)).max() < 0.1  # [mm]: true size, not turned, not mirrored


def test_sheets_have_all_tags_in_true_size():
    pages = tag_sheets("36h11", range(20), 0.04, "a4")
    found = {}
    for page in pages:
        found |= TagFinder(TagConfig()).find(rendered(page))
    assert set(found) == set(range(20))
    sides = [np.linalg.norm(four[0][0] - four[0][1]) for four in found.values()]
    np.testing.assert_allclose(sides, 160.0, atol=0.5)
    assert pdf_of(pages).startswith(b"%PDF-1.4") and pdf_of(pages).endswith(b"%%EOF\n")
