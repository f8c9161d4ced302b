"""Square tags on the tops of bodies: found in an image, and from their corners the bodies' poses.

The plane of the tags is known. So each corner is a ray that meets it at one place, and a body's
pose in the plane is a weighted least squares of these places. That needs no pose of a tag in six
dimensions, which flips between two solutions where a tag is small (apriltag_ros, issue 178).
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from numpy import ndarray

from sain_core.camera.decals import FAMILIES, tag_family
from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.shapes.body_file import BodyFile, Tag
from sain_vision.detection.planar_fit import fit_pose
from sain_vision.detection.sides import brightness, refine_corners
from sain_vision.detection.sighting import Sighting
from sain_vision.optics import CameraModel, PlanePoints

SMALLEST: Final = 10  # [px], side of a tag whose bits can be read in a sharp image
READABLE: Final = 16  # [px], the same with the blur of usual lenses
WINDOWS: Final = (17, 7, 41)
"""Sides [px] of the areas with whose mean brightness a pixel is compared. A shadow or a dark
neighbour spoils a tag in some of them, not in all."""
DARKER: Final = 7  # than this mean, of 255
MOST_AREAS: Final = 200  # dark areas of an image that are read in each window
MOST_COVER: Final = 8  # times the image's size, that these areas span together
CONTRAST: Final = 12.0  # of 255, between a tag's border and the paper
BIT_ERRORS: Final = {"36h11": 2, "25h9": 1, "16h5": 0}
"""Bits that may be wrong. More would find few more tags, and read a tag out of every 400th square
of noise."""
HINTS: Final = 16  # squares without a tag of the family that are read as other families' tags
Grey = UInt8[ndarray, "height width"]
Corners = Float[ndarray, "4 2"]  # [px]: upper left, upper right, lower right, lower left
Squares = Float[ndarray, "M 4 2"]


@dataclass(frozen=True)
class TagConfig(Config):
    """How tags are found, and what of them is believed."""

    family: str = option("36h11", "AprilTag family of the tags", choices=tuple(FAMILIES))
    corner_noise: float = option(
        0.1, "standard deviation of a corner's place", unit="px", minimum=0.01, maximum=5.0
    )
    place_bias: float = option(
        0.0005, "standard deviation of what calibration leaves", unit="m", minimum=0.0
    )
    turn_bias: float = option(0.001, "the same for headings", unit="rad", minimum=0.0)
    max_misfit: float = option(
        10.0,
        "error, in standard deviations of a corner, above which a body is not published",
        minimum=1.0,
    )


class TagFinder:
    """Finds tags in images, in a time that no image can exceed. Not for use by two threads.

    Attributes:
        problems: what is wrong with the latest image, in words.
    """

    def __init__(self, config: TagConfig) -> None:
        self._family = config.family
        self.problems: list[str] = []

    def find(self, image: Grey) -> dict[int, list[Corners]]:
        """Return the corners of each tag that an image shows, by its number."""
        found: dict[int, list[Corners]] = defaultdict(list)
        taken: list[Corners] = []
        unread, crowd = [], ""
        smooth = cv2.GaussianBlur(image, (3, 3), 0)  # or noise makes a thousand areas of one pixel
        for window in WINDOWS:
            squares, areas, read = _dark_squares(smooth, window)
            if read < areas:
                crowd = f"the image has {areas} candidate squares, more than can be read in time:"
                crowd += f" only the {read} largest were read"
            squares = _bordered(image, _apart(squares, taken), self._family)
            squares = refine_corners(image, squares)
            numbers, turns = _numbers(image, squares, self._family, BIT_ERRORS[self._family])
            for four, number, turn in zip(squares, numbers.tolist(), turns.tolist(), strict=True):
                if number >= 0 and len(_apart(four[None], taken)):
                    taken.append(np.roll(four, turn, axis=0))
                    found[number].append(taken[-1])
            unread.append(squares[numbers < 0])
        self.problems = [] if found else _hints(image, np.concatenate(unread), self._family)
        self.problems += [crowd] if crowd else []
        return found


def _dark_squares(image: Grey, window: int) -> tuple[Squares, int, int]:
    """Return dark areas with four corners, how many areas there are, and how many were read."""
    dark = cv2.adaptiveThreshold(
        image, 1, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY_INV, window, DARKER
    )
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(dark, connectivity=4)
    sides = boxes[:, 2:4].min(axis=1)
    sides[0] = 0  # the background
    large = np.flatnonzero((sides > 0.7 * SMALLEST) & (boxes[:, 4] > 2 * SMALLEST))
    cover = boxes[large, 2].astype(float) * boxes[large, 3]
    order = np.argsort(-cover)[:MOST_AREAS]
    order = order[np.cumsum(cover[order]) <= MOST_COVER * image.size]
    squares = []
    for label in large[order].tolist():
        left, top, wide, high, _ = boxes[label].tolist()
        area = (labels[top : top + high, left : left + wide] == label).view(np.uint8)
        (line, *_), _ = cv2.findContours(area, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        length = cv2.arcLength(line, True)
        four = cv2.approxPolyDP(line, 0.03 * length, True)
        if len(four) == 4 and length > 2.8 * SMALLEST and cv2.isContourConvex(four):
            squares.append(four[::-1, 0] + (left, top))  # clockwise in the image
    return np.array(squares, dtype=np.float64).reshape(-1, 4, 2), len(large), len(order)


def _apart(squares: Squares, taken: Sequence[Corners]) -> Float[ndarray, "K 4 2"]:
    """Return the squares that do not lie where others do."""
    if not taken:
        return squares
    others = np.stack(taken)
    sides = np.linalg.norm(others[:, 0] - others[:, 2], axis=1) / 2
    gaps = np.linalg.norm(squares.mean(axis=1)[:, None] - others.mean(axis=1), axis=2)
    return squares[(gaps > 0.5 * sides).all(axis=1)]


def _bordered(image: Grey, squares: Squares, family: str) -> Float[ndarray, "K 4 2"]:
    """Return the squares that have a dark border on bright paper, roughly."""
    _, dark, bright = _modules(image, squares, family)
    return squares[(dark > 0.7) & (bright > 0.6)]


class _Grid(NamedTuple):
    """Where a tag's modules lie, with one row of paper around them.

    Attributes:
        places: (S * S * 4, 2) of four places in each module, on a square from (0, 0) to (1, 1).
        paper: (S * S,) which modules are paper.
        border: (S * S,) which are the black border.
        white: (S * S, W) makes the plane through the paper of the paper's brightness.
        black: (S * S, W) likewise of the border's.
    """

    places: Float[ndarray, "P 2"]
    paper: Bool[ndarray, "C"]
    border: Bool[ndarray, "C"]
    white: Float[ndarray, "C W"]
    black: Float[ndarray, "C B"]


@lru_cache
def _grid(side: int) -> _Grid:
    """Return the grid of a tag with so many modules along its side, the paper included."""
    steps = (np.arange(side)[:, None] + (0.3, 0.7)).ravel() - 1.0
    places = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) / (side - 2)
    from_middle = np.mgrid[:side, :side].reshape(2, -1) - (side - 1) / 2
    ring = np.abs(from_middle).max(axis=0)
    paper, border = ring > side / 2 - 1, (ring < side / 2 - 1) & (ring > side / 2 - 2)
    plane = np.column_stack([np.ones(side**2), *from_middle])
    white, black = (plane @ np.linalg.pinv(plane[which]) for which in (paper, border))
    return _Grid(places, paper, border, white, black)


def _modules(
    image: Grey, squares: Squares, family: str
) -> tuple[Float[ndarray, "M B"], Float[ndarray, "M"], Float[ndarray, "M"]]:
    """Return the inner modules of squares, 1 bright and -1 dark, and the shares that are right.

    These are the shares of the border that is dark, and of the paper around it that is bright.
    Black and white are planes through both, as light may fall unevenly (Wang and Olson 2016).
    """
    side = tag_family(family).shape[1] + 2
    grid = _grid(side)
    read = brightness(image, _on_squares(squares, grid.places))
    values = read.reshape(len(read), side, 2, side, 2).mean(axis=(2, 4)).reshape(len(read), side**2)
    white, black = values[:, grid.paper] @ grid.white.T, values[:, grid.border] @ grid.black.T
    signs = np.where(values > (white + black) / 2, 1.0, -1.0)
    clear = (white - black).min(axis=1) > CONTRAST
    dark, bright = signs[:, grid.border] < 0, signs[:, grid.paper] > 0
    inner = signs[:, ~(grid.paper | grid.border)]
    return inner, clear * dark.mean(axis=1), clear * bright.mean(axis=1)


def _on_squares(squares: Squares, places: Float[ndarray, "P 2"]) -> Float[ndarray, "M P 2"]:
    """Return the pixels of places, of which (0, 0) and (1, 1) are the first and third corner."""
    first, second, third, fourth = squares.transpose(1, 0, 2)
    right, down, bend = second - third, fourth - third, first - second + third - fourth
    area = right[:, 0] * down[:, 1] - down[:, 0] * right[:, 1]
    g = ((bend[:, 0] * down[:, 1] - down[:, 0] * bend[:, 1]) / area)[:, None]
    h = ((right[:, 0] * bend[:, 1] - bend[:, 0] * right[:, 1]) / area)[:, None]
    u, v = places.T
    along, across = second * (1 + g) - first, fourth * (1 + h) - first
    top = along[:, None] * u[:, None] + across[:, None] * v[:, None] + first[:, None]
    return np.asarray(top / (g * u + h * v + 1.0)[..., None])


def _numbers(
    image: Grey, squares: Squares, family: str, most_errors: int, mirrored: bool = False
) -> tuple[Int[ndarray, "M"], Int[ndarray, "M"]]:
    """Return the number of the tag that each square is, or -1, and by how many corners it turns."""
    inner, dark, bright = _modules(image, squares, family)
    codes = _codes(family, mirrored)
    errors = (codes.shape[1] - inner @ codes.T) / 2
    best = errors.argmin(axis=1)
    right = (errors.min(axis=1) <= most_errors) & (dark > 0.85) & (bright > 0.7)
    return np.where(right, best // 4, -1), best % 4


@lru_cache
def _codes(family: str, mirrored: bool) -> Float[ndarray, "C B"]:
    """Return the bits of each tag at each of its four turns, 1 bright and -1 dark."""
    bits = 1.0 - 2.0 * tag_family(family)[:, 1:-1, 1:-1]
    bits = bits[:, :, ::-1] if mirrored else bits
    turned = np.stack([np.rot90(bits, turn, axes=(1, 2)) for turn in range(4)], axis=1)
    return turned.reshape(4 * len(bits), -1)


def _hints(image: Grey, squares: Squares, family: str) -> list[str]:
    """Return in words why squares that look like tags are none of the family."""
    squares = squares[:HINTS]
    if (_numbers(image, squares, family, 0, mirrored=True)[0] >= 0).any():
        return ["the image shows tags mirrored; publish the camera's images unflipped"]
    for other in FAMILIES:
        numbers, _ = _numbers(image, squares, other, 0)
        if other != family and (numbers >= 0).any():
            return [f"the tags in the image are of family {other}; tags.family is {family}"]
    return []


class TagLocator:
    """From the corners of tags to the poses of the bodies that carry them."""

    def __init__(self, bodies: BodyFile, config: TagConfig) -> None:
        """Take the tags of bodies. Raises `ConfigError`: a body has a tag that the family lacks."""
        count = len(tag_family(config.family))
        for body, tags in enumerate(bodies.tags):
            for tag in tags:
                if tag.number >= count:
                    raise ConfigError(
                        f"{bodies.called(body)} has tag {tag.number}; family {config.family} has"
                        f" the tags 0 to {count - 1}"
                    )
        self._bodies, self._config = bodies, config
        self._bias = np.diag(np.square([config.place_bias, config.place_bias, config.turn_bias]))

    def locate(
        self, found: Mapping[int, Sequence[Corners]], camera: CameraModel
    ) -> tuple[list[Sighting], list[str]]:
        """Return the bodies whose tags were found, and in words what is wrong with others."""
        sightings: list[Sighting] = []
        problems = self._too_small(found, camera)
        for body, tags in enumerate(self._bodies.tags):
            seen = [tag for tag in tags if tag.number in found]
            twice = [tag.number for tag in seen if len(found[tag.number]) > 1]
            if twice:
                problems.append(
                    f"tag {twice[0]} of {self._bodies.called(body)} is seen"
                    f" {len(found[twice[0]])} times; each tag may be on one body only"
                )
            elif seen:
                corners = np.stack([found[tag.number][0] for tag in seen])
                sighting, problem = self._fit(body, seen, corners, camera)
                if sighting is not None:
                    sightings.append(sighting)
                else:
                    problems.append(problem)
        return sightings, problems

    def _too_small(self, found: Mapping[int, Sequence[Corners]], camera: CameraModel) -> list[str]:
        """Return which tags are not found, and too small to be read in the image's middle."""
        middle = np.array([[camera.width / 2, camera.height / 2]])
        problems = []
        for body, tags in enumerate(self._bodies.tags):
            spread = camera.spread_on_plane(middle, self._bodies.heights[body])[0]
            (a, b), (c, d) = spread.tolist()
            grain = abs(a * d - b * c) ** 0.5  # [m/px]; NaN: no table there
            small = [t for t in tags if t.number not in found and t.size < READABLE * grain]
            if small:
                problems.append(
                    f"tag {small[0].number} of {self._bodies.called(body)} has"
                    f" {small[0].size / grain:.0f} px along its side in this camera's images;"
                    f" {READABLE} px are needed: print it larger, or move the camera nearer"
                )
        return problems

    def _fit(
        self, body: int, tags: Sequence[Tag], corners: Float[ndarray, "T 4 2"], camera: CameraModel
    ) -> tuple[Sighting | None, str]:
        height, pixels = self._bodies.heights[body], corners.reshape(-1, 2)
        places = camera.on_plane(pixels, height)
        name = self._bodies.called(body)
        if not np.isfinite(camera.slopes(pixels)).all():
            return None, (
                f"{name} is seen where the distortion of the camera's lens cannot be inverted; move"
                " it to the image's middle, or calibrate with looks at the image's edge"
            )
        spreads = camera.spread_on_plane(pixels, height)
        if not (np.isfinite(places).all() and np.isfinite(spreads).all()):
            return None, (
                f"{name} is seen where the camera does not look down onto the table; check the"
                " camera's pose on /tf_static"
            )
        covariances = self._config.corner_noise**2 * spreads @ spreads.transpose(0, 2, 1)
        fit = fit_pose(np.concatenate([tag.corners() for tag in tags]), places, covariances)
        if fit.misfit > self._config.max_misfit:
            return None, (
                f"the tags of {name} do not fit its file by {fit.misfit:.0f} standard deviations;"
                f" at most {self._config.max_misfit:g} is allowed: {_sizes(tags, places)}; check"
                " size, place and height, and the camera's pose"
            )
        score = len(tags) / len(self._bodies.tags[body])
        return Sighting(body, fit.pose, fit.covariance + self._bias, corners, score), ""


def _sizes(tags: Sequence[Tag], places: PlanePoints) -> str:
    """Return in words how large tags seem, whose corners are seen at places (4 T, 2)."""
    corners = places.reshape(len(tags), 4, 2)
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1)
    return ", ".join(
        f"tag {tag.number} seems {1e3 * side:.1f} mm large, and is {1e3 * tag.size:g} mm"
        for tag, side in zip(tags, sides.tolist(), strict=True)
    )
