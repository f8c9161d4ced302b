"""A film of trials side by side, replayed from their bags: arms, bodies, goals and clocks."""

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Final

from PIL import Image

from sain_arm.robot.robot import read_robot
from sain_bags.reading.reader import Bag
from sain_bags.rows.episodes import read_episodes
from sain_bringup.movie import (
    Moment,
    Words,
    choose_moments,
    encode_gif,
    episode_moments,
    render,
    write_words,
)
from sain_core.camera.image_camera import ImageCameraConfig
from sain_core.errors import DatasetError
from sain_core.scene import RADIUS
from sain_core.view.palette import PALETTE

SPEED: Final = 2.0  # time of the arm by shown time
RATE: Final = 1 / 0.12  # [Hz], of pictures; a GIF counts time in steps of 10 ms
COLOURS: Final = 64
LONGEST: Final = 36.0  # [s] of the arm's time
COLUMNS: Final = 2
GAP: Final = 4  # [px], between cells
CAMERA: Final = ImageCameraConfig(  # before the arm, which hides little of the bodies
    width=320, height=240, eye=(1.25, -0.35, 1.15), focus=(0.48, 0.0, 0.06), field_of_view=29.0
)


def film(bags: Mapping[str, tuple[Path, str]]) -> bytes:
    """Return a GIF of bags side by side, by titles; each with the robot that moved in it.

    Raises:
        DatasetError: a bag is damaged, or none has a goal.
    """
    clips = [clip(Bag(path), robot, title) for title, (path, robot) in bags.items()]
    if not any(clips):
        raise DatasetError(f"no goal is in the recordings of {', '.join(bags)}; give --film others")
    return encode_gif(side_by_side([one for one in clips if one]), RATE, COLOURS)


def clip(bag: Bag, robot: str, title: str) -> list[Image.Image]:
    """Return pictures of a bag from its first goal on; none, if it has no goal."""
    from sain_sim.camera.renderer import Renderer  # takes a second to load

    parts = [part for one in read_episodes(bag) for part in one.by_goal if part.goal is not None]
    moments = episode_moments(bag, *parts)
    times = [moment.time for moment in moments]
    moments = moments[: bisect_right(times, times[0] + LONGEST) if times else 0]
    if not moments:
        return []

    def describe(one: Moment) -> Words:
        return clocks(moments[: bisect_right(times, one.time)])

    bodies, radii = parts[0].bodies, parts[0].start[:, RADIUS].tolist()
    renderer = Renderer(read_robot(robot), bodies, radii, CAMERA)
    shown = choose_moments(moments, SPEED, RATE, len(moments))
    frames = render(renderer, bodies, shown, describe)
    for frame in frames:
        write_words(frame, ((title, PALETTE.ink), (f"   {SPEED:g}x", PALETTE.soft)), 1)
    return frames


def clocks(past: Sequence[Moment]) -> Words:
    """Return the time since each goal so far; it stands for one that is reached."""
    words = []
    for _, some in groupby(past, key=lambda moment: id(moment.judged.goal)):
        towards = list(some)
        reached = next((one for one in towards if one.settled and one.judged.met), None)
        colour = PALETTE.success if reached else PALETTE.ink
        words.append((f" {(reached or towards[-1]).since:.1f} s ", colour))
    return words


def side_by_side(clips: Sequence[Sequence[Image.Image]]) -> list[Image.Image]:
    """Return pictures of all clips at once, in rows; the last one of a shorter clip stays."""
    width, height = CAMERA.width + GAP, CAMERA.height + GAP
    columns = min(COLUMNS, len(clips))
    size = width * columns - GAP, height * -(-len(clips) // columns) - GAP
    sheets = []
    for number in range(max(map(len, clips))):
        sheets.append(Image.new("RGB", size, PALETTE.paper))
        for place, one in enumerate(clips):
            row, column = divmod(place, columns)
            sheets[-1].paste(one[min(number, len(one) - 1)], (column * width, row * height))
    return sheets
