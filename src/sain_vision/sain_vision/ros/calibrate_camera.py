"""``sain calibrate_camera``: where a camera is, from looks at a board on the table."""

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console

from sain_core.config import Config, check_angle, check_text, option
from sain_core.errors import ConfigError, SainError
from sain_core.guarding.untrusted import check_frame
from sain_core.output import OVERWRITE_HELP, claim_file
from sain_vision.detection.calibration import (
    BOARD_FAMILY,
    FEWEST_TAGS,
    Look,
    board_corners,
    calibrate,
    match_board,
)
from sain_vision.detection.tags import TagConfig, TagFinder
from sain_vision.extrinsics_file import Extrinsics, write_extrinsics
from sain_vision.optics import TABLE, turn_of


@dataclass(frozen=True)
class CalibrateOptions(Config):
    """Find out where a camera is, from ten looks at a board that lies flat on the table.

    `sain print --board` writes the board. In the first look its origin lies at a known place of
    the world; then it lies anywhere, near all corners of the image. The result is a file for
    `tag_node`. A bad one is refused.
    """

    out: Path = option(Path("runs/camera.yaml"), "file to write")
    overwrite: bool = option(False, OVERWRITE_HELP)
    origin: tuple[float, float, float] = option(
        (0.4, 0.0, 0.0), "of the board in the first look: x [m], y [m] and turn [rad] in the world"
    )
    interval: float = option(
        0.0, "time between looks; 0: Enter takes one", unit="s", minimum=0.0, maximum=60.0
    )
    looks: int = option(10, "looks at the board", minimum=2, maximum=100)
    max_error: float = option(
        1.0, "largest error of a place on the table, p95", unit="mm", minimum=0.01
    )
    max_bias: float = option(0.5, "largest mean error of a look's places", unit="mm", minimum=0.01)

    def __post_init__(self) -> None:
        super().__post_init__()
        x, y, turn = self.origin
        if not TABLE.contains(np.array([x, y])):
            raise ConfigError(f"origin is ({x:g}, {y:g}) m; it must be in {TABLE.describe()}")
        check_angle("origin's turn", turn)


def run(options: CalibrateOptions, console: Console) -> None:
    """Take looks and write the file.

    Raises `SainError`: no images, too few tags, or a bad result.
    """
    from sain_core.ros.node_main import command_node
    from sain_vision.ros.camera_input import ImageWatcher
    from sain_vision.ros.images import decode_grey

    claim_file(options.out, options.overwrite)
    finder = TagFinder(TagConfig(family=BOARD_FAMILY))
    looks: list[Look] = []
    with command_node("calibrate_camera") as node:
        watcher = ImageWatcher(node)
        while len(looks) < options.looks:
            number = len(looks) + 1
            where = "with its origin at its place" if number == 1 else "somewhere else"
            _wait(options, console, f"look {number} of {options.looks}: board {where}")
            message, camera = watcher.next_image()
            frame = check_frame(
                "frame_id of images", check_text("frame_id of images", message.header.frame_id)
            )
            look = match_board(finder.find(decode_grey(message)))
            count = f"  {len(look.points) // 4} of {len(board_corners())} tags"
            console.print(count, *finder.problems, sep="; ")
            if len(look.points) >= 4 * FEWEST_TAGS:
                looks.append(look)
    limits = options.max_error, options.max_bias
    made = calibrate(camera, looks, np.array(options.origin), *limits)
    pose = Extrinsics(frame, "world", made.camera.place, turn_of(made.camera.rotation))
    about = {"error_mm": round(made.error, 3), "bias_mm": [round(one, 3) for one in made.bias]}
    write_extrinsics(options.out, pose, about)
    console.print(
        f"places on the table are exact to {made.error:.2f} mm (p95), the first board is off by"
        f" {made.bias[0]:.2f}, {made.bias[1]:.2f} mm\n{options.out}: give it to tag_node as"
        f" extrinsics:={options.out.absolute()}"
    )


def _wait(options: CalibrateOptions, console: Console, text: str) -> None:
    if options.interval > 0.0:
        console.print(text)
        time.sleep(options.interval)
        return
    try:
        console.input(f"{text}, then Enter ")
    except EOFError as error:
        raise SainError("there is no terminal to wait for Enter; give --interval") from error
