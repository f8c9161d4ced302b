"""Square tags on the tops of bodies: found in an image, and from their corners the bodies' poses.

The plane of the tags is known. So each corner is a ray that meets it at one place, and a body's
pose in the plane is a weighted least squares of these places. That needs no pose of a tag in six
dimensions, which flips between two solutions where a tag is small (apriltag_ros, issue 178).
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from sain_core.config import Config, option
from sain_core.shapes.body_file import BodyFile, Tag
from sain_vision.detection.planar_fit import fit_pose
from sain_vision.detection.sides import refine_corners
from sain_vision.detection.sighting import Sighting
from sain_vision.optics import CameraModel

FAMILIES: Final = {
    "36h11": cv2.aruco.DICT_APRILTAG_36h11,
    "25h9": cv2.aruco.DICT_APRILTAG_25h9,
    "16h5": cv2.aruco.DICT_APRILTAG_16h5,
}
SMALLEST: Final = 10  # [px], side of a tag whose bits can be read
Grey = UInt8[ndarray, "height width"]
Corners = Float[ndarray, "4 2"]  # [px]: upper left, upper right, lower right, lower left


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
    window: int = option(
        17, "side of the area whose mean brightness is compared with", unit="px", minimum=3
    )


class TagFinder:
    """Finds tags in images. Not for use by two threads."""

    def __init__(self, config: TagConfig) -> None:
        """Look for tags of a family."""
        settings = cv2.aruco.DetectorParameters()
        settings.adaptiveThreshWinSizeMin = settings.adaptiveThreshWinSizeMax = config.window | 1
        settings.minMarkerPerimeterRate = 0.005
        # Bits are read from their middles: half of a blurred bit is its neighbours'.
        settings.perspectiveRemovePixelPerCell = 8
        settings.perspectiveRemoveIgnoredMarginPerCell = 0.25
        settings.errorCorrectionRate = 0.9
        family = cv2.aruco.getPredefinedDictionary(FAMILIES[config.family])
        self._detector = cv2.aruco.ArucoDetector(family, settings)

    def find(self, image: Grey) -> dict[int, list[Corners]]:
        """Return the corners of each tag that an image shows, by its number."""
        corners, numbers, _ = self._detector.detectMarkers(image)
        found: dict[int, list[Corners]] = defaultdict(list)
        if numbers is None:
            return found
        quads = np.concatenate(corners).astype(np.float64)
        large = [cv2.arcLength(four[0], closed=True) >= 4 * SMALLEST for four in corners]
        quads, shown = quads[large], numbers.ravel()[large]
        for four, number in zip(refine_corners(image, quads), shown.tolist(), strict=True):
            found[number].append(four)
        return found


class TagLocator:
    """From the corners of tags to the poses of the bodies that carry them."""

    def __init__(self, bodies: BodyFile, config: TagConfig) -> None:
        """Know which body has which tags."""
        self._bodies, self._config = bodies, config
        self._bias = np.diag(np.square([config.place_bias, config.place_bias, config.turn_bias]))

    def locate(
        self, found: Mapping[int, Sequence[Corners]], camera: CameraModel
    ) -> tuple[list[Sighting], list[str]]:
        """Return the bodies whose tags were found, and in words what is wrong with others."""
        sightings, problems = [], []
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

    def _fit(
        self, body: int, tags: Sequence[Tag], corners: Float[ndarray, "T 4 2"], camera: CameraModel
    ) -> tuple[Sighting | None, str]:
        height, pixels = self._bodies.heights[body], corners.reshape(-1, 2)
        places = camera.on_plane(pixels, height)
        name = self._bodies.called(body)
        if not np.isfinite(places).all():
            return None, (
                f"{name} is seen where the camera does not look down onto the table; check the"
                " camera's pose on /tf_static"
            )
        spreads = camera.spread_on_plane(pixels, height)
        covariances = self._config.corner_noise**2 * spreads @ spreads.transpose(0, 2, 1)
        fit = fit_pose(np.concatenate([tag.corners() for tag in tags]), places, covariances)
        if fit.misfit > self._config.max_misfit:
            return None, (
                f"the tags of {name} do not fit its file by {fit.misfit:.0f} standard deviations;"
                f" at most {self._config.max_misfit:g} is allowed: check size, place and height of"
                f" {', '.join(f'tag {tag.number}' for tag in tags)}, and the camera's pose"
            )
        score = len(tags) / len(self._bodies.tags[body])
        return Sighting(body, fit.pose, fit.covariance + self._bias, corners, score), ""
