"""How exact poses from images are: tags of bodies on a table, seen by the simulated camera.

Bodies at random poses about the middle of the table, each with one tag; the camera is 1 m away,
oblique. Errors are those of a single image.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import tyro

from benchmarks.report import Figure, report
from sain_core.randomness import generator
from sain_core.scene import POSE, make_scene, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.body_file import BodyFile, Tag
from sain_core.types import Scene
from sain_sim.camera.image_camera import ImageCamera, ImageCameraConfig
from sain_vision.detection.tags import TagConfig, TagFinder, TagLocator
from sain_vision.optics import CameraModel

MIDDLE = (0.5, 0.0, 0.04)  # [m]
AWAY = np.array([0.0, -0.9, 0.0, -2.6, 0.0, 1.8, 0.78])  # [rad], out of sight
ROWS, COLUMNS = 2, 3
APART = 0.2  # [m]


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


def bodies_with_tags(count: int, size: float) -> BodyFile:
    """Return disks of which each has the tag with its own number."""
    return BodyFile(
        bodies=Bodies.named(("disk",) * count),
        names=tuple(f"body_{body}" for body in range(count)),
        radii=(0.06,) * count,
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


def main() -> None:
    """Measure."""
    options = tyro.cli(Options, description=__doc__)
    cv2.setNumThreads(1)
    off = options.distance * np.array([0.55, 0.1, 0.83]) / np.linalg.norm([0.55, 0.1, 0.83])
    x, y, z = (np.array(MIDDLE) + off).tolist()
    config = replace(
        ImageCameraConfig(),
        eye=(x, y, z),
        focus=MIDDLE,
        distortion=options.lens,
        tag_size=options.size,
        noise=options.noise,
        blur=options.blur,
    )
    model = CameraModel(
        config.width, config.height, config.matrix, np.array(options.lens), *config.stated_pose
    )
    count, random = ROWS * COLUMNS, generator(options.seed, "noise")
    settings = TagConfig()
    finder, locator = (
        TagFinder(settings),
        TagLocator(bodies_with_tags(count, options.size), settings),
    )
    errors, shown = [], 0
    every = list(scenes(options))
    with ImageCamera(config, every[0], ("disk",) * count) as camera:
        for scene in every:
            shot = camera.take(AWAY, scene, random)
            grey = np.asarray(cv2.cvtColor(shot.colour, cv2.COLOR_RGB2GRAY))
            sightings, _ = locator.locate(finder.find(grey), model)
            shown += count
            for one in sightings:
                error = one.pose - scene[one.body, POSE]
                error[2] = wrap_angle(error[2])
                errors.append(error)
    off_by = np.array(errors)
    places = 1e3 * np.hypot(off_by[:, 0], off_by[:, 1])
    turns = np.degrees(np.abs(off_by[:, 2]))
    report(
        f"Tags of {1e3 * options.size:g} mm at {options.distance:g} m, {len(every)} images of"
        f" {config.width} x {config.height} px",
        [
            Figure("bodies that were found", 100 * len(errors) / shown, "%", at_least=99),
            Figure("error of position, p95", float(np.quantile(places, 0.95)), "mm", at_most=1.5),
            Figure("error of heading, p95", float(np.quantile(turns, 0.95)), "deg", at_most=0.5),
            Figure("error of position, largest", float(places.max()), "mm"),
            Figure("error of heading, largest", float(turns.max()), "deg"),
        ],
        options.out,
    )


if __name__ == "__main__":
    main()
