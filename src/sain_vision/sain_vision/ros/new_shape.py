"""``sain new_shape``: the outline of an object without a tag, from a look at it or a mesh."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
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
from sain_core.scene import DISK_HEIGHT
from sain_core.shapes.library import OUTLINES, PLAIN, outline_folder, shape_names
from sain_core.shapes.meshes import FORMATS, UNITS, UPWARD, MeshBody, read_mesh
from sain_core.shapes.outlines import (
    FAIR,
    FAIR_SHARES,
    HEIGHT,
    MASS,
    MASS_CENTRE,
    METRES,
    OUTLINE,
    SHAPES,
    UNIT,
    BodyOutline,
    trace,
)
from sain_core.types import Points
from sain_vision.detection.sighting import grey_of
from sain_vision.detection.tracing import TracedTop, draw_top, trace_top
from sain_vision.extrinsics_file import read_extrinsics
from sain_vision.optics import CameraModel

SCALE: Final = 2  # times as large a picture is shown


@dataclass(frozen=True)
class NewShapeOptions(Config):
    """Make a shape of an object on the table, from a look of a depth camera or from a mesh.

    The object lies alone in the image, wholly visible, the arm away. The command writes a picture
    and asks, then writes the outline. A mesh is taken as it lies, seen from above. After that its
    name is a shape, wherever shapes are named.
    """

    name: Annotated[str, tyro.conf.Positional] = option("", "of the shape")
    mesh: Path | None = option(None, f"{', '.join(FORMATS)} file to take it from, not the camera")
    unit: str = option("m", "of the mesh", choices=tuple(UNITS))
    up: str = option("z", "axis of the mesh that points upwards; -z: upside down", choices=UPWARD)
    density: float | None = option(
        None, "of a closed mesh, for its mass", unit="kg/m^3", minimum=1.0, maximum=25_000.0
    )
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
    if options.mesh is not None:
        claim_file(options.path, options.overwrite)
        found = read_mesh(options.mesh, options.name, options.unit, options.up, options.density)
        console.print(f"{options.name}: {describe_mesh(found)}", highlight=False, soft_wrap=True)
        _keep(options, found.body, console)
        return
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
    _keep(options, replace(body, height=top.height), console)


def _keep(options: NewShapeOptions, body: BodyOutline, console: Console) -> None:
    """Write the file of a body, and print its line in a file of bodies."""
    write_whole(options.path, content_of(options.name, body).encode())
    shape = options.name if options.out is None else options.out.absolute()
    row = f"name: {options.name}, shape: '{shape}:flat', radius: {body.radius:.4f}"
    row += f", height: {body.height:.3f}" + (f", mass: {body.mass:.3f}" if body.mass else "")
    console.print(
        f"{options.path}\nin a file of bodies:  - {{{row}}}", highlight=False, soft_wrap=True
    )


def describe(top: TracedTop, body: BodyOutline) -> str:
    """Return what a shape is, in words."""
    long, short = _sides(top.outline)
    others = f"one of {top.count} objects, chosen by --near or as the largest; "
    return others * (top.count > 1) + (
        f"{long:.0f} x {short:.0f} mm, {1e3 * top.height:.0f} mm high, radius"
        f" {1e3 * body.radius:.1f} mm, {len(top.outline)} corners within"
        f" {1e3 * top.tolerance:g} mm, {len(body.shape.parts(1.0))} convex parts"
    )


def describe_mesh(found: MeshBody) -> str:
    """Return what a body of a mesh is, in words, and whether it can be pushed as a flat one."""
    body, shares = found.body, ", ".join(f"{share:.2f}" for share in found.slices)
    long, short = _sides(body.shape.outline(body.radius))
    high = 1e3 * (body.height or 0.0)
    lines = [
        f"{long:.0f} x {short:.0f} mm, {high:.0f} mm high, radius"
        f" {1e3 * body.radius:.1f} mm, {len(body.shape.outline(1.0))} corners within"
        f" {1e3 * found.tolerance:g} mm, {len(body.shape.parts(1.0))} convex parts",
        f"a fair flat body: {body.fair} (slices at a quarter, half and three quarters of the height"
        f" have {shares} of the area; from {FAIR_SHARES[0]} it is one, from {FAIR_SHARES[1]}"
        " roughly)"
        if body.fair
        else "a fair flat body: unknown, for the slices of the open mesh do not close",
        f"pushed {1e3 * DISK_HEIGHT / 2:.0f} mm above the table, it tips before it slides where the"
        f" friction is above {found.steady:.2f}"
        + ("; it is higher than wide, so a fast push may tip it" if high > short else ""),
    ]
    if body.mass_centre is not None:
        x, y = (1e3 * place for place in body.mass_centre)
        mass = f"mass {body.mass:.3g} kg" if body.mass else "--density gives the mass"
        lines.append(f"centre of mass at ({x:.1f}, {y:.1f}) mm from the centroid; {mass}")
    return "\n".join((*lines, *body.mended))


def _sides(outline: Points) -> tuple[float, float]:
    """Return the longer and the shorter side [mm] of the box about an outline (M, 2) [m]."""
    long, short = sorted(cv2.minAreaRect(outline.astype(np.float32))[1], reverse=True)
    return 1e3 * long, 1e3 * short


def content_of(name: str, body: BodyOutline) -> str:
    """Return the file of a body; its outline is about its centroid."""
    about = {
        OUTLINE: body.shape.outline(body.radius).round(5).tolist(),
        HEIGHT: None if body.height is None else round(body.height, 4),
        MASS: None if body.mass is None else round(body.mass, 4),
        MASS_CENTRE: None if body.mass_centre is None else [round(v, 5) for v in body.mass_centre],
        FAIR: body.fair or None,
    }
    stated = {key: value for key, value in about.items() if value is not None}
    return dump_yaml({SHAPES: {name: stated}, UNIT: METRES})


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
