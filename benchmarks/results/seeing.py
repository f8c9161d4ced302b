"""How exact poses from images are: of tags and of outlines, seen by the simulated camera.

Bodies lie at random poses about the middle of the table; the camera is 1 m away, oblique. Errors
are those of a single image, and of bodies of which nothing was known before.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import tyro
from jaxtyping import Float
from numpy import ndarray

from benchmarks.report import Figure, report
from sain_core.camera.image_camera import ImageCameraConfig
from sain_core.randomness import generator
from sain_core.scene import POSE, RADIUS, make_scene, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.body_file import BodyFile, Tag
from sain_core.types import Scene
from sain_sim.camera.render import image_camera
from sain_vision.detection.outlines import OutlineConfig, OutlineFinder
from sain_vision.detection.sighting import Sighting
from sain_vision.detection.tags import TagConfig, TagFinder, TagLocator
from sain_vision.optics import CameraModel

MIDDLE = (0.5, 0.0, 0.04)  # [m]
AWAY = np.array([0.0, -0.9, 0.0, -2.6, 0.0, 1.8, 0.78])  # [rad], out of sight
ROWS, COLUMNS = 2, 3
APART = 0.2  # [m]
AHEAD = (0.549, 0.1, 0.83)  # from the middle towards the camera
RADII = (0.1, 0.07)  # [m], of the T and the disk

Errors = Float[ndarray, "S 4"]  # [m], [m], [rad] and the body


@dataclass(frozen=True)
class Options:
    """How much to measure."""

    images: int = 50
    """Images of six bodies each."""
    distance: float = 1.0
    """From the camera to the middle of the bodies [m]."""
    size: float = 0.04
    """Side of the tags [m]."""
    lens: tuple[float, float, float, float, float] = (-0.05, 0.02, 0.0005, -0.0005, 0.0)
    """Distortion."""
    noise: float = 4.0
    """Of a pixel's brightness, of 255."""
    blur: float = 0.8
    """[px]"""
    seed: int = 0
    """Of poses and noise."""
    out: Path | None = None
    """Write the figures to this JSON file."""


def bodies_with_tags(shapes: tuple[str, ...], size: float) -> BodyFile:
    """Return bodies of which each has the tag with its own number."""
    count = len(shapes)
    return BodyFile(
        bodies=Bodies.named(shapes),
        names=tuple(f"body_{body}" for body in range(count)),
        radii=RADII if count == len(RADII) else (0.06,) * count,
        masses=(1.0,) * count,
        heights=(0.04,) * count,
        tags=tuple((Tag(body, size),) for body in range(count)),
        frames=("",) * count,
        topics=("",) * count,
        weighed=True,
    )


def scenes(options: Options) -> Iterator[Scene]:
    """Yield scenes of bodies near the nodes of a grid."""
    random = generator(options.seed, "seeing")
    across, along = np.meshgrid(np.arange(COLUMNS) - 1.0, np.arange(ROWS) - 0.5)
    grid = np.array(MIDDLE[:2]) + APART * np.stack([along.ravel(), across.ravel()], axis=1)
    for _ in range(options.images):
        places = grid + random.uniform(-0.05, 0.05, grid.shape)
        count = len(grid)
        headings = random.uniform(-np.pi, np.pi, count)
        yield make_scene(places, np.full(count, 8.0), np.full(count, 0.06), headings)


def measure_tags(options: Options) -> tuple[str, Errors, int]:
    """Return what was measured, the errors of poses from tags, and how many could be found."""
    config = replace(
        ImageCameraConfig(),
        eye=eye_of(options),
        focus=MIDDLE,
        distortion=options.lens,
        tag_size=options.size,
        noise=options.noise,
        blur=options.blur,
    )
    model, random = model_of(config), generator(options.seed, "noise")
    count, settings = ROWS * COLUMNS, TagConfig()
    finder = TagFinder(settings)
    locator = TagLocator(bodies_with_tags(("disk",) * count, options.size), settings)
    errors, every = [], list(scenes(options))
    with image_camera(config, every[0], ("disk",) * count) as camera:
        for scene in every:
            shot = camera.take(AWAY, scene, random)
            grey = np.asarray(cv2.cvtColor(shot.colour, cv2.COLOR_RGB2GRAY))
            errors += errors_of(locator.locate(finder.find(grey), model)[0], scene)
    what = f"Tags of {1e3 * options.size:g} mm, {config.width} x {config.height} px"
    return what, np.array(errors), count * len(every)


def measure_outlines(options: Options) -> tuple[str, Errors, int]:
    """Return the same of outlines in depth images: a T and a disk, found anywhere on the table."""
    config = replace(
        ImageCameraConfig(),
        width=640,
        height=480,
        detail=1.0,
        field_of_view=50.0,
        eye=eye_of(options),
        focus=MIDDLE,
        tag_size=0.0,
    )
    model, random = model_of(config), generator(options.seed, "noise")
    shapes, settings = ("t:flat", "disk"), OutlineConfig()
    finder = OutlineFinder(bodies_with_tags(shapes, options.size), settings)
    errors, every = [], [scene[[0, 5]] for scene in scenes(options)]
    for scene in every:
        scene[:, RADIUS] = RADII
    with image_camera(config, every[0], shapes) as camera:
        for scene in every:
            depth = camera.take(AWAY, scene, random).depth * 1e-3
            found, _ = finder.find(np.where(depth > 0.0, depth, np.nan), model, {})
            errors += errors_of(found, scene)
    for error in errors:
        error[2] = error[2] if error[3] == 0 else 0.0  # a disk's heading cannot be seen
    what = f"Outlines of a T and a disk, depth of {config.width} x {config.height} px"
    return what, np.array(errors), len(shapes) * len(every)


def eye_of(options: Options) -> tuple[float, float, float]:
    """Return where the camera stands [m]."""
    x, y, z = (np.array(MIDDLE) + options.distance * np.array(AHEAD)).tolist()
    return x, y, z


def model_of(config: ImageCameraConfig) -> CameraModel:
    """Return the camera as its calibration has it."""
    lens = np.array(config.distortion)
    return CameraModel(config.width, config.height, config.matrix, lens, *config.stated_pose)


def errors_of(sightings: Sequence[Sighting], scene: Scene) -> list[Float[ndarray, "4"]]:
    """Return by how much each pose is off, and of which body it is."""
    errors = []
    for one in sightings:
        x, y, turn = (one.pose - scene[one.body, POSE]).tolist()
        errors.append(np.array([x, y, float(wrap_angle(np.asarray(turn))), float(one.body)]))
    return errors


def main() -> None:
    """Measure."""
    options = tyro.cli(Options, description=__doc__)
    cv2.setNumThreads(1)
    for measure, most, turn in ((measure_tags, 1.5, 0.5), (measure_outlines, 2.5, 1.5)):
        what, errors, shown = measure(options)
        places = 1e3 * np.hypot(errors[:, 0], errors[:, 1])
        turns = np.degrees(np.abs(errors[:, 2]))
        figures = [
            Figure("bodies that were found", 100 * len(errors) / shown, "%", at_least=99),
            Figure("position, p95", float(np.quantile(places, 0.95)), "mm", at_most=most),
            Figure("heading, p95", float(np.quantile(turns, 0.95)), "deg", at_most=turn),
            Figure("position, largest", float(places.max()), "mm"),
            Figure("heading, largest", float(turns.max()), "deg"),
        ]
        out = options.out and options.out.with_stem(f"{options.out.stem}_{measure.__name__[8:]}")
        report(f"{what}, at {options.distance:g} m, {shown} bodies", figures, out)


if __name__ == "__main__":
    main()
