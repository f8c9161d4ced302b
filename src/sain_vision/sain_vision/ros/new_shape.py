"""``sain new_shape``: the outline of an object without a tag, from one look at it."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import cv2
import numpy as np
import tyro
from rich.console import Console

from sain_core.config import Config, option
from sain_core.errors import ConfigError, InvalidInputError, SainError
from sain_core.guarding.documents import dump_yaml
from sain_core.output import OVERWRITE_HELP, claim_file, write_whole
from sain_core.shapes.library import OUTLINES, PLAIN, outline_folder, shape_names
from sain_core.shapes.outlines import METRES, SHAPES, UNIT, BodyOutline, trace
from sain_vision.detection.sighting import grey_of
from sain_vision.detection.tracing import TracedTop, draw_top, trace_top
from sain_vision.extrinsics_file import read_extrinsics
from sain_vision.optics import CameraModel

SCALE: Final = 2  # times as large a picture is shown


@dataclass(frozen=True)
class NewShapeOptions(Config):
    """Make a shape of an object on the table, from a look of a depth camera.

    The object lies alone in the image, wholly visible, the arm away. The command writes a picture
    and asks, then writes the outline. After that its name is a shape, wherever shapes are named.
    """

    name: Annotated[str, tyro.conf.Positional] = option("", "of the shape")
    near: tuple[float, float] | None = option(
        None, "place of the object, x and y; without it, the largest", unit="m"
    )
    extrinsics: Path | None = option(None, "file of calibrate_camera; without it, from /tf")
    frames: int = option(10, "depth images that are averaged", minimum=1, maximum=100)
    out: Path | None = option(None, "file to write; by default NAME.yaml among this user's shapes")
    overwrite: bool = option(False, OVERWRITE_HELP)
    yes: bool = option(False, "write without asking")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not PLAIN.fullmatch(self.name):
            raise ConfigError(
                f"name is {self.name!r}; allowed: letters, digits, '_', '-' and '.', up to 64, no"
                " '-' or '.' first, no .yaml or .json last"
            )
        if self.out is not None and self.out.suffix not in ("", OUTLINES[0]):
            raise ConfigError(f"out is {self.out}; its name must end in {OUTLINES[0]}")
        if self.name in shape_names() and not (self.overwrite and self.path.exists()):
            raise ConfigError(
                f"there is a shape {self.name!r}; take another name; or, if it is one of yours,"
                " --overwrite"
            )

    @property
    def path(self) -> Path:
        """The file to write."""
        return self.out or outline_folder() / f"{self.name}.yaml"


def run(options: NewShapeOptions, console: Console) -> None:
    """Look, show and write.

    Raises `SainError`: no look, no object, or the user does not confirm.
    """
    shown = options.path.with_suffix(".png")
    for path in (options.path, shown):
        claim_file(path, options.overwrite)
    depth, camera, picture = _look(options)
    near = None if options.near is None else np.array(options.near)
    top = trace_top(depth, camera, near)
    body = trace(options.name, top.outline)
    what = describe(top, body)
    draw_top(picture, top, camera, options.name)
    large = cv2.resize(picture, None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_LINEAR)
    write_whole(shown, cv2.imencode(".png", large)[1].tobytes())
    console.print(f"{options.name}: {what}\npicture: {shown}", highlight=False)
    _confirm(options, console)
    write_whole(options.path, content_of(options.name, top, body).encode())
    shape = options.name if options.out is None else options.out.absolute()
    row = f"name: {options.name}, shape: '{shape}:flat', radius: {body.radius:.4f}"
    console.print(
        f"{options.path}\nin a file of bodies:  - {{{row}, height: {top.height:.3f}}}",
        highlight=False,
        soft_wrap=True,
    )


def describe(top: TracedTop, body: BodyOutline) -> str:
    """Return what a shape is, in words."""
    box = cv2.minAreaRect(top.outline.astype(np.float32))[1]
    long, short = sorted((1e3 * side for side in box), reverse=True)
    others = f"one of {top.count} objects, chosen by --near or as the largest; "
    return others * (top.count > 1) + (
        f"{long:.0f} x {short:.0f} mm, {1e3 * top.height:.0f} mm high, radius"
        f" {1e3 * body.radius:.1f} mm, {len(top.outline)} corners within"
        f" {1e3 * top.tolerance:g} mm, {len(body.shape.parts(1.0))} convex parts"
    )


def content_of(name: str, top: TracedTop, body: BodyOutline) -> str:
    """Return the file of an outline, about its centroid."""
    corners = (top.outline - np.array(body.centre)).round(5).tolist()
    about = {UNIT: METRES, "height": round(top.height, 4), "radius": round(body.radius, 5)}
    return dump_yaml({SHAPES: {name: corners}, **about})


def _confirm(options: NewShapeOptions, console: Console) -> None:
    if options.yes:
        return
    try:
        answer = console.input("Does the line follow its edge? Enter writes the shape, n does not ")
    except EOFError as error:
        raise SainError("there is no terminal to confirm; look at the picture, give --yes") from (
            error
        )
    if answer.strip():
        raise SainError("nothing was written; turn the object, or move the camera, and look again")


def _look(options: NewShapeOptions) -> tuple[np.ndarray, CameraModel, np.ndarray]:
    """Return depth [m], the camera at its place, and a picture in blue, green and red."""
    from sain_core.ros.node_main import command_node
    from sain_vision.ros.camera_input import ImageWatcher
    from sain_vision.ros.images import decode_depth, decode_grey
    from sain_vision.ros.settings import DEPTH_TOPICS

    depths: list[np.ndarray] = []
    with command_node("new_shape") as node:
        watcher = ImageWatcher(node, DEPTH_TOPICS, placed=options.extrinsics is None)
        while len(depths) < options.frames:
            message, camera = watcher.next_image()
            depths.append(decode_depth(message))
        depth = averaged(depths)
        picture = np.asarray(cv2.cvtColor(grey_of(depth), cv2.COLOR_GRAY2BGR))
        with suppress(InvalidInputError):  # depth alone is a picture, too
            grey = decode_grey(ImageWatcher(node).next_image()[0])
            picture = (
                cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR) if grey.shape == depth.shape else picture
            )
    if options.extrinsics is not None:
        camera = read_extrinsics(options.extrinsics).placed(camera)
    return depth, camera, picture


def averaged(depths: Sequence[Any]) -> np.ndarray:
    """Return the median of depth images [m]; NaN where most have none."""
    stack = np.stack(depths)
    seen = np.isfinite(stack).mean(axis=0) > 0.5
    return np.where(seen, np.nanmedian(np.where(seen, stack, 0.0), axis=0), np.nan)
