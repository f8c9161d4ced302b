"""Where a camera is, from looks at a board that lies on the table.

In the first look the board lies where the world has a known place. In the others it lies anywhere
on the table; their places are unknown, and all that counts is that the board is flat and rigid. So
looks far apart show errors of the camera's tilt, height and lens, which one look hides.

The board has tags in rows, whose numbers count up from the lower left one on, where its origin is.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import cv2
import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.optimize import least_squares

from sain_core.errors import InvalidInputError
from sain_core.shapes.body_file import Tag
from sain_core.types import Points
from sain_vision.detection.planar_fit import fit_pose, turned
from sain_vision.optics import CameraModel, Pixels, check_view

BOARD_FAMILY: Final = "36h11"
FIRST: Final = 500  # number of the board's first tag
COLUMNS, ROWS = 5, 6
SIZE: Final = 0.028  # [m], side of a tag
GAP: Final = 0.008  # [m], between tags
STEP: Final = SIZE + GAP
EXTENT: Final = (COLUMNS * STEP, ROWS * STEP)  # [m], width and height from the origin
FEWEST_TAGS: Final = 8  # of the board, in each look
COVERAGE: Final = 0.25  # share of the image's width and height that all looks span
Pose = Float[ndarray, "3"]


class Look(NamedTuple):
    """Points (P, 2) [m] of the board, and where an image shows them (P, 2) [px]."""

    points: Points
    pixels: Pixels


def board_corners() -> dict[int, Points]:
    """Return the corners (4, 2) [m] of each tag in the board's frame, by its number."""
    middle = GAP + SIZE / 2
    return {
        FIRST + row * COLUMNS + column: Tag(
            0, SIZE, middle + column * STEP, middle + row * STEP
        ).corners()
        for row in range(ROWS)
        for column in range(COLUMNS)
    }


def match_board(found: Mapping[int, Sequence[ndarray]]) -> Look:
    """Return the look at the board of tags that were found once."""
    own = board_corners()
    numbers = [number for number in own if len(found.get(number, ())) == 1]
    nothing = np.zeros((0, 2))
    return Look(
        np.concatenate([nothing, *(own[number] for number in numbers)]),
        np.concatenate([nothing, *(found[number][0] for number in numbers)]),
    )


@dataclass(frozen=True, eq=False)
class Calibration:
    """A camera at its place, and how far its looks are from a rigid board on the table."""

    camera: CameraModel
    error: float  # of a corner's place on the table, p95 [mm]
    bias: tuple[float, float]  # [mm], mean error of the first look, whose board's place is given


def calibrate(
    camera: CameraModel,
    looks: Sequence[Look],
    first: Pose,
    max_error: float = 1.0,
    max_bias: float = 0.5,
) -> Calibration:
    """Return the camera at the place that fits all looks; the first board is at a known pose.

    Errors [mm] of places, p95, and the mean of the first look's, may be so large. Raises
    `InvalidInputError`: too few tags, looks that are all alike, or a bad result.
    """
    _check_looks(camera, looks)
    start = _start(camera, looks[0], first)
    poses = [
        fit_pose(one.points, start.on_plane(one.pixels, 0.0), _units(len(one.points))).pose
        for one in looks[1:]
    ]
    turn, _ = cv2.Rodrigues(start.rotation)
    begin = np.concatenate([turn.ravel(), start.place, *poses])
    lost = [number for number, pose in enumerate(poses, start=2) if not np.isfinite(pose).all()]
    if lost:
        raise InvalidInputError(
            f"look {lost[0]} shows the board where, after the first look, no table is: the board"
            " must lie flat, and the camera stand still; repeat the looks"
        )

    def errors(values: Float[ndarray, "V"]) -> Float[ndarray, "E"]:
        seen = _camera_at(camera, values)
        boards = [first, *values[6:].reshape(-1, 3)]
        off = [
            seen.project(_on_table(one.points, board)) - one.pixels
            for one, board in zip(looks, boards, strict=True)
        ]
        return np.nan_to_num(np.concatenate(off).ravel(), nan=1e3)

    solved = least_squares(errors, begin, loss="huber", f_scale=0.5, x_scale="jac")
    return _checked(_camera_at(camera, solved.x), looks, first, max_error, max_bias)


def _check_looks(camera: CameraModel, looks: Sequence[Look]) -> None:
    for number, one in enumerate(looks, start=1):
        if len(one.points) < 4 * FEWEST_TAGS:
            raise InvalidInputError(
                f"look {number} shows {len(one.points) // 4} tags of the board; at least"
                f" {FEWEST_TAGS} are needed: bring it nearer, or light it evenly"
            )
    middles = np.stack([one.pixels.mean(axis=0) for one in looks])
    span = np.ptp(middles, axis=0) / (camera.width, camera.height)
    if span.min() < COVERAGE:
        raise InvalidInputError(
            f"the looks span {100 * span[0]:.0f} % of the image's width and {100 * span[1]:.0f} %"
            f" of its height; both must be {100 * COVERAGE:.0f} %: lay the board near all corners"
        )


def _start(camera: CameraModel, look: Look, board: Pose) -> CameraModel:
    """Return the camera as the first look alone has it."""
    placed = _on_table(look.points, board)
    slopes = camera.slopes(look.pixels)
    if not np.isfinite(slopes).all():
        raise InvalidInputError(
            "the camera's lens has no inverse where the first look shows the board; lay it nearer"
            " to the image's middle, and check the camera's own calibration"
        )
    ok, turn, shift = cv2.solvePnP(placed, slopes, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    rotation = cv2.Rodrigues(turn)[0].T
    start = camera.moved(np.asarray(rotation), -np.asarray(rotation @ shift)[:, 0])
    if not ok or start.place[2] <= 0.0 or not np.isfinite(start.place).all():
        raise InvalidInputError("the first look puts the camera below the table; repeat the looks")
    return start


def _camera_at(camera: CameraModel, values: Float[ndarray, "V"]) -> CameraModel:
    return camera.moved(np.asarray(cv2.Rodrigues(values[:3])[0]), values[3:6])


def _on_table(points: Points, board: Pose) -> Float[ndarray, "P 3"]:
    places = turned(points, float(board[2])) + board[:2]
    return np.column_stack([places, np.zeros(len(places))])


def _units(count: int) -> Float[ndarray, "P 2 2"]:
    return np.tile(np.eye(2), (count, 1, 1))


def _checked(
    camera: CameraModel, looks: Sequence[Look], first: Pose, max_error: float, max_bias: float
) -> Calibration:
    """Return a calibration with its errors, or raise what is wrong with it."""
    off, scales = [], []
    for one in looks:
        places = camera.on_plane(one.pixels, 0.0)
        fit = fit_pose(one.points, places, _units(len(places)))
        off.append(places - _on_table(one.points, fit.pose)[:, :2])
        sizes = [np.linalg.norm(values - values.mean(axis=0)) for values in (places, one.points)]
        scales.append(sizes[0] / sizes[1])
    known = camera.on_plane(looks[0].pixels, 0.0) - _on_table(looks[0].points, first)[:, :2]
    error = 1e3 * float(np.quantile(np.linalg.norm(np.concatenate(off), axis=1), 0.95))
    bias = 1e3 * known.mean(axis=0)
    if not error <= max_error:
        raise InvalidInputError(
            f"places on the table are off by {error:.2f} mm (p95); at most {max_error:g} mm is"
            f" accepted. The board seems {100 * (np.mean(scales) - 1.0):+.2f} % larger than it is:"
            " measure the ruler on it, and check the camera's own calibration"
        )
    if not np.linalg.norm(bias) <= max_bias:
        raise InvalidInputError(
            f"the first board is off by {bias[0]:.2f}, {bias[1]:.2f} mm; at most {max_bias:g} mm is"
            " accepted: was it where --origin says?"
        )
    check_view(camera, "the calibrated camera")
    return Calibration(camera, error, (float(bias[0]), float(bias[1])))
