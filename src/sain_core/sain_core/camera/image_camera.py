"""A camera that takes images of a world, colour and depth, with the errors of a real one.

A renderer, which is given, draws arm, table and bodies; tags are painted on the bodies' tops. Lens,
blur, exposure and noise follow. So the camera is the same in all engines.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, Protocol, Self

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8, UInt16
from numpy import ndarray

from sain_core.camera.decals import paint_tag
from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.scene import POSE
from sain_core.shapes.body_file import Tag
from sain_core.types import Scene

MILLIMETRES: Final = 1000.0
ASIDE: Final = 0.0005  # [m], in the plane from a camera to what it looks at
DIGITS: Final = 5  # of places [m] and angles [rad] that a picture shows
SHIFTS: Final = 1 << 18  # of noise, from image to image
MOST_DEPTH: Final = 6.0  # [m], of a depth camera

Matrix = Float[ndarray, "3 3"]


@dataclass(frozen=True)
class ImageCameraConfig(Config):
    """A camera over the table, by default as a RealSense D435's colour camera."""

    width: int = option(1280, "of the image", unit="px", minimum=64, maximum=4096)
    height: int = option(720, "of the image", unit="px", minimum=64, maximum=4096)
    eye: tuple[float, float, float] = option((1.15, 0.0, 0.95), "where it stands", unit="m")
    focus: tuple[float, float, float] = option((0.55, 0.0, 0.0), "what it looks at", unit="m")
    field_of_view: float = option(43.0, "vertical", unit="deg", minimum=5.0, maximum=120.0)
    light: tuple[float, float, float] = option((0.6, -1.2, 2.4), "where light is from", unit="m")
    rate: float = option(
        10.0, "images per second, while somebody subscribes", unit="Hz", minimum=0.1, maximum=60.0
    )
    detail: float = option(
        0.5, "share of the size in which all but tags is drawn", minimum=0.1, maximum=1.0
    )
    tag_size: float = option(
        0.04, "side of the tag on each body, whose number is the body's; 0: none", unit="m",
        minimum=0.0, maximum=0.2,
    )  # fmt: skip
    noise: float = option(
        3.0, "standard deviation of a pixel's brightness, of 255", minimum=0.0, maximum=100.0
    )
    blur: float = option(
        0.7, "standard deviation of the blur", unit="px", minimum=0.0, maximum=10.0
    )
    exposure: float = option(1.0, "factor of the brightness", minimum=0.05, maximum=10.0)
    distortion: tuple[float, float, float, float, float] = option(
        (0.0, 0.0, 0.0, 0.0, 0.0), "of the lens, as plumb_bob: k1, k2, p1, p2, k3"
    )
    depth_noise: float = option(
        0.001, "standard deviation of a distance", unit="m", minimum=0.0, maximum=0.1
    )
    misplaced: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0), "by how much the place on /tf_static is wrong", unit="m"
    )
    misturned: tuple[float, float, float] = option(
        (0.0, 0.0, 0.0), "by how much its turn is wrong, about the camera's axes", unit="rad"
    )

    def __post_init__(self) -> None:
        """Check the fields, and that the image has an upright."""
        super().__post_init__()
        if not np.hypot(*np.subtract(self.focus, self.eye)[:2]) > ASIDE:
            raise ConfigError(
                f"the camera at {self.eye} m looks straight up or down at {self.focus} m, where its"
                f" image has no upright; move eye or focus by more than {ASIDE:g} m in x or y"
            )

    @property
    def matrix(self) -> Matrix:
        """Focal lengths and principal point [px], from the centre of the upper left pixel."""
        focal = self.height / 2 / np.tan(np.radians(self.field_of_view) / 2)
        across, down = (self.width - 1) / 2, (self.height - 1) / 2
        return np.array([[focal, 0.0, across], [0.0, focal, down], [0.0, 0.0, 1.0]])

    @property
    def rotation(self) -> Matrix:
        """From the optical frame (x right, y down, z ahead) to the world."""
        ahead = np.subtract(self.focus, self.eye)
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, (0.0, 0.0, 1.0))
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(ahead, right), ahead], axis=1)

    @property
    def stated_pose(self) -> tuple[Matrix, Float[ndarray, "3"]]:
        """Rotation and place as the calibration has them: wrong by what the settings say."""
        error, _ = cv2.Rodrigues(np.array(self.misturned))
        return self.rotation @ error, np.add(self.eye, self.misplaced)


class Drawing(NamedTuple):
    """What a renderer draws: without lens, blur and noise."""

    colour: UInt8[ndarray, "height width 3"]  # red, green, blue
    depth: Float[ndarray, "height width"]  # along the optical axis [m]
    hides: Bool[ndarray, "height width"]  # where something is before the bodies' tops: the arm


class ImageRenderer(Protocol):
    """Draws a world as an `ImageCameraConfig` has it, but without the errors of a camera."""

    def drawing(self, joints: Any, scene: Scene, width: int, height: int) -> Drawing:
        """Return the arm with joints (J,), table and bodies (N, 8), in so many pixels."""
        ...


class Shot(NamedTuple):
    """What a camera takes at one moment."""

    colour: UInt8[ndarray, "height width 3"]  # red, green, blue
    depth: UInt16[ndarray, "height width"]  # along the optical axis [mm]; 0: unknown


class _Ideal(NamedTuple):
    """A shot through the lens, without noise; where no depth is known, it is 0 [mm]."""

    colour: UInt8[ndarray, "height width 3"]
    depth: Float[ndarray, "height width"]


class _Grain(NamedTuple):
    """Noise of more pixels than an image has: each image has a part of it, for drawing takes long.

    Added to brighter colours, what is taken from them would overflow.
    """

    brighter: UInt8[ndarray, "P 3"]  # added to colours
    darker: UInt8[ndarray, "P 3"]  # taken from colours
    nearer: Float[ndarray, "P"]  # taken from distances [mm]

    @classmethod
    def drawn(cls, config: ImageCameraConfig, random: np.random.Generator) -> Self:
        """Draw it."""
        count = config.width * config.height + SHIFTS
        levels = (config.noise * random.standard_normal(count, dtype=np.float32)).round()
        levels = np.repeat(levels[:, None], 3, axis=1)
        nearer = random.standard_normal(count, dtype=np.float32)
        return cls(
            np.clip(levels, 0, 255).astype(np.uint8),
            np.clip(-levels, 0, 255).astype(np.uint8),
            np.float32(MILLIMETRES * config.depth_noise) * nearer,
        )

    def part(self, random: np.random.Generator, size: tuple[int, int]) -> list[ndarray]:
        """Return the same for an image of a width and height, from anywhere."""
        width, height = size
        start = int(random.integers(SHIFTS))
        parts = (one[start : start + width * height] for one in self)
        return [one.reshape(height, width, *one.shape[1:]) for one in parts]


class ImageCamera:
    """Takes images of an arm, a table and N bodies. Not for use by two threads."""

    def __init__(
        self,
        config: ImageCameraConfig,
        renderer: ImageRenderer,
        tags: Sequence[Sequence[Tag]],
        tops: Sequence[float],
    ) -> None:
        """Take what a renderer draws, with tags on the top of each body (N,) [m]."""
        self.config = config
        self._renderer, self._tags = renderer, tags
        self._size = config.width, config.height
        self._planes = [_plane(config, top) for top in tops]
        self._lens = _lens_map(config)
        self._key = b""
        self._ideal: _Ideal | None = None
        self._grain: _Grain | None = None

    def take(self, joints: ndarray, scene: Scene, random: np.random.Generator) -> Shot:
        """Return an image of the arm with joints (J,) and of the bodies (N, 8)."""
        key = joints.round(DIGITS).tobytes() + scene[:, POSE].round(DIGITS).tobytes()
        if key != self._key or self._ideal is None:  # a world at rest is drawn once
            self._key, self._ideal = key, self._draw(joints, scene)
        colour, depth = self._ideal
        if self._grain is None:
            self._grain = _Grain.drawn(self.config, random)
        brighter, darker, nearer = self._grain.part(random, self._size)
        seen = cv2.subtract(cv2.add(colour, brighter), darker)
        millimetres = np.where(depth > 0.0, depth - nearer, 0.0).astype(np.uint16)
        return Shot(np.asarray(seen), millimetres)

    def _draw(self, joints: ndarray, scene: Scene) -> _Ideal:
        config, (width, height) = self.config, self._size
        small = round(config.detail * width), round(config.detail * height)
        drawn = self._renderer.drawing(joints, scene, *small)
        colour = cv2.resize(
            drawn.colour.astype(np.float32), self._size, interpolation=cv2.INTER_LINEAR
        )
        hides, depth = (
            np.asarray(cv2.resize(one, self._size, interpolation=cv2.INTER_NEAREST))
            for one in (drawn.hides.astype(np.uint8), drawn.depth.astype(np.float32))
        )
        for pose, plane, tags in zip(scene[:, POSE], self._planes, self._tags, strict=True):
            for tag in tags:
                paint_tag(colour, tag, plane, pose, hides > 0)
        if self._lens is not None:
            colour = cv2.remap(colour, *self._lens, cv2.INTER_LINEAR)
            depth = cv2.remap(depth, *self._lens, cv2.INTER_NEAREST)
        if config.blur > 0.0:
            colour = cv2.GaussianBlur(colour, (0, 0), config.blur)
        colour = np.clip(np.float32(config.exposure) * np.asarray(colour) + 0.5, 0, 255)
        known = (np.asarray(depth) > 0.0) & (np.asarray(depth) < MOST_DEPTH)
        millimetres = np.where(known, np.float32(MILLIMETRES) * depth + 0.5, 0.0)
        return _Ideal(colour.astype(np.uint8), millimetres)


def _plane(config: ImageCameraConfig, height: float) -> Matrix:
    """Return the homography from places [m] in a plane over the table to pixels."""
    world = np.column_stack([np.eye(3)[:, :2], (0.0, 0.0, height) - np.array(config.eye)])
    return np.asarray(config.matrix @ config.rotation.T @ world)


def _lens_map(config: ImageCameraConfig) -> tuple[ndarray, ndarray] | None:
    """Return where in an image without distortion each pixel looks; None: there is none."""
    if not any(config.distortion):
        return None
    grid = np.stack(np.meshgrid(np.arange(config.width), np.arange(config.height)), axis=-1)
    flat = cv2.undistortPoints(
        grid.reshape(-1, 1, 2).astype(np.float64),
        config.matrix,
        np.array(config.distortion),
        P=config.matrix,
    ).reshape(config.height, config.width, 2)
    return flat[..., 0].astype(np.float32), flat[..., 1].astype(np.float32)
