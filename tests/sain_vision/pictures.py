"""Pictures of tags on a table, as a camera takes them: with noise, blur and a lens."""

from collections.abc import Iterable

import cv2
import numpy as np

from sain_core.camera.decals import paint_tag
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.body_file import BodyFile, Tag
from sain_vision.optics import CameraModel

SIZE = 0.04  # [m], of a tag
HEIGHT = 0.04  # [m], of a top


def looking_at(eye: tuple[float, ...], focus: tuple[float, ...], **options: float) -> CameraModel:
    """Return a camera as a RealSense D435's at 1280 x 720, that looks at a place."""
    place, target = np.array(eye), np.array(focus)
    ahead = (target - place) / np.linalg.norm(target - place)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(ahead, right), ahead], axis=1)
    width, height = 1280, 720
    matrix = np.array([[910.0, 0, (width - 1) / 2], [0, 910.0, (height - 1) / 2], [0, 0, 1]])
    return CameraModel(width, height, matrix, np.zeros(5), rotation, place)


CAMERA = looking_at((-0.05, 0.1, 0.85), (0.45, 0.0, HEIGHT))  # 1 m away, oblique


def file_of(*tags: tuple[Tag, ...]) -> BodyFile:
    """Return disks with these tags."""
    count = len(tags)
    return BodyFile(
        bodies=Bodies.named(("disk",) * count),
        names=tuple(f"body_{n}" for n in range(count)),
        radii=(0.06,) * count,
        masses=(1.0,) * count,
        tags=tags,
        frames=("",) * count,
        topics=("",) * count,
        weighed=True,
    )


def plane_of(camera: CameraModel, height: float = HEIGHT) -> np.ndarray:
    """Return the homography (3, 3) from places at a height [m] to pixels, without distortion."""
    world = np.column_stack([np.eye(3)[:, :2], (0.0, 0.0, height) - camera.place])
    return camera.matrix @ camera.rotation.T @ world


def take(
    camera: CameraModel,
    tags: Iterable[tuple[int, np.ndarray]],
    random: np.random.Generator,
    blur: float = 0.8,
    noise: float = 4.0,
    size: float = SIZE,
) -> np.ndarray:
    """Return a grey picture (height, width) of tags, each with its number and pose (3,)."""
    picture = np.full((camera.height, camera.width, 3), 180.0)
    hidden = np.zeros(picture.shape[:2], dtype=bool)
    for number, pose in tags:
        paint_tag(picture, Tag(number, size), plane_of(camera), pose, hidden)
    seen = distorted(picture[..., 0], camera)
    seen = cv2.GaussianBlur(seen, (0, 0), blur) if blur else seen
    seen = seen + noise * random.standard_normal(seen.shape)
    return np.clip(seen, 0, 255).astype(np.uint8)


def tilted(
    camera: CameraModel, number: int, place: np.ndarray, turn: np.ndarray, size: float = SIZE
) -> np.ndarray:
    """Return a grey picture of one tag whose top has a place (3,) [m] and a rotation (3, 3)."""
    plane = camera.matrix @ camera.rotation.T @ np.column_stack([turn[:, :2], place - camera.place])
    picture = np.full((camera.height, camera.width, 3), 180.0)
    hidden = np.zeros(picture.shape[:2], dtype=bool)
    paint_tag(picture, Tag(number, size), plane, np.zeros(3), hidden)
    return np.asarray(cv2.GaussianBlur(picture[..., 0], (0, 0), 0.8)).astype(np.uint8)


def distorted(picture: np.ndarray, camera: CameraModel) -> np.ndarray:
    """Return a picture as the camera's lens shows it."""
    if not camera.distortion.any():
        return picture
    grid = np.stack(np.meshgrid(np.arange(camera.width), np.arange(camera.height)), axis=-1)
    flat = cv2.undistortPoints(
        grid.reshape(-1, 1, 2).astype(np.float64), camera.matrix, camera.distortion,
        P=camera.matrix,
    ).reshape(camera.height, camera.width, 2)  # fmt: skip
    return np.asarray(cv2.remap(picture, flat.astype(np.float32), None, cv2.INTER_CUBIC))
