"""Square tags on the tops of bodies: found in an image, and from their corners the bodies' poses.

The plane of the tags is known. So each corner is a ray that meets it at one place, and a body's
pose in the plane is a weighted least squares of these places. That needs no pose of a tag in six
dimensions, which flips between two solutions where a tag is small (apriltag_ros, issue 178). Only
where nothing in the plane fits, one tells whether a body has tipped over.

A corner alone is as exact as the few pixels about it. A side of 35 pixels is a line through as
many of them, so corners that are the ends of lines are several times as exact.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from sain_core.camera.decals import FAMILIES, tag_family
from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.shapes.body_file import BodyFile, Tag
from sain_core.wire import TIPPED, UPRIGHT
from sain_vision.detection.planar_fit import fit_pose
from sain_vision.detection.sighting import Sighting
from sain_vision.optics import CameraModel, Pixels, PlanePoints

SMALLEST: Final = 10  # [px], side of a tag whose bits can be read in a sharp image
READABLE: Final = 16  # [px], the same with the blur of usual lenses
LEAST: Final = 0.03  # of an image's longer side, the perimeter of a square that is looked at
BIT_ERRORS: Final = {"36h11": 2, "25h9": 1, "16h5": 0}
"""Bits that may be wrong. More would find few more tags, and read a tag out of every 400th square
of noise."""
HINTS: Final = 100  # squares that are none of the family, at most, where others are looked for
ALONG: Final = np.linspace(0.12, 0.88, 24)  # of a side, where its edge is looked for
SAMPLES: Final = 21  # across an edge
REACHES: Final = ((4.0, 0.11), (2.5, 0.07), (2.5, 0.07))
"""[px] to both sides of an edge, and at most so much of a side, in each round: a tag's black border
and the white one around it are an eighth of a side."""
FARTHEST: Final = 4.0  # [px], a corner that moves more is left as it was found

Grey = UInt8[ndarray, "height width"]
Corners = Float[ndarray, "4 2"]  # [px]: upper left, upper right, lower right, lower left
Quads = Float[ndarray, "M 4 2"]


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
    """Finds tags in images. Not for use by two threads.

    Attributes:
        problems: what is wrong with the latest image, in words.
    """

    def __init__(self, config: TagConfig) -> None:
        self._family = config.family
        self._detector = _detector(config.family, BIT_ERRORS[config.family])
        self.problems: list[str] = []

    def find(self, image: Grey) -> dict[int, list[Corners]]:
        """Return the corners of each tag that an image shows, by its number."""
        squares, numbers, others = self._detector.detectMarkers(image)
        found: dict[int, list[Corners]] = defaultdict(list)
        if numbers is not None:
            # OpenCV has its tags upside down.
            corners = np.roll(np.concatenate(squares).astype(np.float64), 2, axis=1)
            for number, four in zip(numbers.ravel(), _refine_corners(image, corners), strict=True):
                found[int(number)].append(four)
        few = not found and 0 < len(others) <= HINTS
        self.problems = _hints(image, self._family) if few else []
        return found


@lru_cache
def _detector(family: str, bit_errors: int) -> cv2.aruco.ArucoDetector:
    """Return what finds tags of a family of which so many bits may be wrong."""
    tags = cv2.aruco.getPredefinedDictionary(FAMILIES[family])
    tags.maxCorrectionBits = bit_errors
    given = cv2.aruco.DetectorParameters()
    # A shadow or a dark neighbour spoils a tag in some windows [px], not in all.
    given.adaptiveThreshWinSizeMin, given.adaptiveThreshWinSizeMax = 7, 41
    given.adaptiveThreshWinSizeStep = 17
    # With smaller squares, an image that is full of them takes half a minute.
    given.minMarkerPerimeterRate = LEAST
    given.minDistanceToBorder, given.errorCorrectionRate = 1, 1.0
    given.maxErroneousBitsInBorderRate = 0.2
    # Of each module its middle, which neighbours do not blur.
    given.perspectiveRemovePixelPerCell, given.perspectiveRemoveIgnoredMarginPerCell = 8, 0.3
    return cv2.aruco.ArucoDetector(tags, given)


def _hints(image: Grey, family: str) -> list[str]:
    """Return in words why squares that look like tags are none of the family."""
    if _detector(family, 0).detectMarkers(image[:, ::-1].copy())[1] is not None:
        return ["the image shows tags mirrored; publish the camera's images unflipped"]
    for other in FAMILIES:
        if other != family and _detector(other, 0).detectMarkers(image)[1] is not None:
            return [f"the tags in the image are of family {other}; tags.family is {family}"]
    return []


def _refine_corners(image: Grey, corners: Quads) -> Quads:
    """Return the corners of M dark squares on white from the lines along their sides."""
    refined = corners
    for pixels, share in REACHES:
        sides = np.linalg.norm(np.roll(refined, -1, axis=1) - refined, axis=2)
        refined = _refined(image, refined, np.minimum(pixels, share * sides.min(axis=1)))
    moved = np.linalg.norm(refined - corners, axis=2).max(axis=1)
    kept = np.isfinite(moved) & (moved < FARTHEST)
    return np.where(kept[:, None, None], refined, corners)


def _refined(image: Grey, corners: Quads, reach: Float[ndarray, "M"]) -> Quads:
    """Return corners from edges that are no farther from the sides than a reach [px]."""
    ends = np.roll(corners, -1, axis=1)
    ways = ends - corners  # (M, 4, 2)
    lengths = np.linalg.norm(ways, axis=2)
    # Clockwise in the image, where y points down: outward is the way turned to its left.
    normals = np.stack([ways[..., 1], -ways[..., 0]], axis=-1) / lengths[..., None]
    places = corners[:, :, None] + ALONG[:, None] * ways[:, :, None]  # (M, 4, A, 2)
    offsets = reach[:, None] * np.linspace(-1.0, 1.0, SAMPLES)  # (M, C)
    sampled = (
        places[:, :, :, None] + offsets[:, None, None, :, None] * normals[:, :, None, None]
    )  # (M, 4, A, C, 2)
    x, y = sampled.astype(np.float32).reshape(len(sampled), -1, 2).transpose(2, 0, 1)
    values = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    profiles = values.reshape(sampled.shape[:-1]).astype(np.float64)
    rises = np.maximum(np.diff(profiles, axis=-1), 0.0)
    middles = (offsets[:, 1:] + offsets[:, :-1])[:, None, None] / 2
    shifts = (rises * middles).sum(axis=-1) / np.maximum(rises.sum(axis=-1), 1e-9)  # (M, 4, A)
    edges = places + shifts[..., None] * normals[:, :, None]
    return _intersections(*_lines(edges))


def _lines(edges: Float[ndarray, "M 4 A 2"]) -> tuple[ndarray, ndarray]:
    """Return a point (M, 4, 2) and a direction (M, 4, 2) of the line nearest to places."""
    middle = edges.mean(axis=2)
    away = edges - middle[:, :, None]
    spread = np.einsum("msai,msaj->msij", away, away)
    return middle, np.linalg.eigh(spread)[1][..., 1]


def _intersections(points: ndarray, ways: ndarray) -> Quads:
    """Return the corners (M, 4, 2) where each line meets the one before it."""
    before, way = np.roll(points, 1, axis=1), np.roll(ways, 1, axis=1)
    cross = way[..., 0] * ways[..., 1] - way[..., 1] * ways[..., 0]
    gap = points - before
    share = (gap[..., 0] * ways[..., 1] - gap[..., 1] * ways[..., 0]) / np.where(
        np.abs(cross) > 1e-6, cross, np.nan
    )
    return np.asarray(before + share[..., None] * way)


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
        """Return the bodies whose tags were found, and in words what is wrong with them or others.

        One that has tipped over is among them, with its rotation.
        """
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
                sightings += [] if sighting is None else [sighting]
                problems += [problem] if problem else []
        return sightings, problems

    def _too_small(self, found: Mapping[int, Sequence[Corners]], camera: CameraModel) -> list[str]:
        """Return which tags are not found, and too small to be read in the image's middle."""
        middle = np.array([[camera.width / 2, camera.height / 2]])
        needed = max(READABLE, 0.3 * LEAST * max(camera.width, camera.height))  # [px]
        problems = []
        for body, tags in enumerate(self._bodies.tags):
            spread = camera.spread_on_plane(middle, self._bodies.heights[body])[0]
            (a, b), (c, d) = spread.tolist()
            grain = abs(a * d - b * c) ** 0.5  # [m/px]; NaN: no table there
            small = [t for t in tags if t.number not in found and t.size < needed * grain]
            if small:
                problems.append(
                    f"tag {small[0].number} of {self._bodies.called(body)} has"
                    f" {small[0].size / grain:.0f} px along its side in this camera's images;"
                    f" {needed:.0f} px are needed: print it larger, or move the camera nearer"
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
        score = len(tags) / len(self._bodies.tags[body])
        if fit.misfit > self._config.max_misfit:
            if (tipped := self._tipped(body, tags, pixels, camera)) is not None:
                pose, rotation, tilt = tipped
                tilted = Sighting(body, pose, fit.covariance, corners, score, rotation)
                return tilted, f"{name} is tilted by {tilt:.0f} degrees{TIPPED}"
            return None, (
                f"the tags of {name} do not fit its file by {fit.misfit:.0f} standard deviations;"
                f" at most {self._config.max_misfit:g} is allowed: {_sizes(tags, places)}; check"
                " size, place and height, the camera's pose, and that it stands upright"
            )
        return Sighting(body, fit.pose, fit.covariance + self._bias, corners, score), ""

    def _tipped(
        self, body: int, tags: Sequence[Tag], pixels: Pixels, camera: CameraModel
    ) -> tuple[Float[ndarray, "3"], Float[ndarray, "3 3"], float] | None:
        """Return pose, rotation and tilt [degrees] of a body that has tipped over; None: it stands.

        Its tags then have a pose in six dimensions. That of a small tag is one of two, mirrored at
        the line of sight: both must be tilted, where both fit.
        """
        flat = np.concatenate([tag.corners() for tag in tags])
        points, slopes = np.column_stack([flat, np.zeros(len(flat))]), camera.slopes(pixels)
        _, turns, places, errors = cv2.solvePnPGeneric(
            points, slopes, np.eye(3), np.zeros(0), flags=cv2.SOLVEPNP_IPPE
        )
        most = self._config.max_misfit * self._config.corner_noise / camera.matrix[0, 0]
        fitting = [  # the best first
            (camera.rotation @ cv2.Rodrigues(turn)[0], camera.rotation @ place[:, 0] + camera.place)
            for turn, place, error in zip(turns, places, errors.ravel(), strict=True)
            if error <= most
        ]
        if not fitting or max(rotation[2, 2] for rotation, _ in fitting) >= UPRIGHT:
            return None
        rotation, top = fitting[0]
        middle = top - self._bodies.heights[body] / 2 * rotation[:, 2]
        heading = np.arctan2(rotation[1, 0], rotation[0, 0])
        tilt = float(np.degrees(np.arccos(rotation[2, 2])))
        return np.array([*middle[:2], heading]), rotation, tilt


def _sizes(tags: Sequence[Tag], places: PlanePoints) -> str:
    """Return in words how large tags seem, whose corners are seen at places (4 T, 2)."""
    corners = places.reshape(len(tags), 4, 2)
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1)
    return ", ".join(
        f"tag {tag.number} seems {1e3 * side:.1f} mm large, and is {1e3 * tag.size:g} mm"
        for tag, side in zip(tags, sides.tolist(), strict=True)
    )
