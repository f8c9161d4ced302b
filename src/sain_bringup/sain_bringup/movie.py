"""A short moving picture of one episode, replayed from its recording.

The arm's joints and the disks come from the bag and nothing is simulated again: what is shown
is what happened.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray
from PIL import Image, ImageDraw, ImageFont

from sain_bags.reading.reader import Bag
from sain_bags.rows.episodes import Episode
from sain_bags.rows.topics import SCENE
from sain_bringup.graph import NAMESPACE_KEY
from sain_core.camera.image_camera import ImageCameraConfig
from sain_core.goal import Judgement
from sain_core.types import Points, Scene
from sain_core.view.palette import PALETTE
from sain_core.wire import decode_disks, decode_stamp

if TYPE_CHECKING:
    from sain_sim.camera.renderer import Renderer  # takes a second to load

JOINTS: Final = "sensor_msgs/msg/JointState"
MARGIN: Final = 16  # [px]
SPEED: Final = 3.0  # simulated time by shown time
RATE: Final = 12.0  # [Hz], of pictures
HOLD: Final = 2.0  # [s] that the last picture stands
CAMERA: Final = ImageCameraConfig(  # where the arm rarely hides the target or the goal
    width=480, height=360, eye=(1.75, -0.5, 1.2), focus=(0.42, 0.02, 0.16), field_of_view=36.0
)
LONGEST: Final = 60  # pictures at most; a longer episode is shown faster
SAMPLES: Final = 8  # pictures that the common palette is made from
SWATCH: Final = 40  # [px], rows that a rare colour gets in the sheet for the palette

Picture = UInt8[ndarray, "height width 3"]


@dataclass(frozen=True)
class Moment:
    """The world at one time."""

    time: float  # [s], simulated
    joints: Float[ndarray, "J"]  # [rad]
    scene: Scene  # (N, 8)
    judged: Judgement  # how far it is from the goal


def episode_moments(bag: Bag, episode: Episode) -> list[Moment]:
    """Return everything that was seen of an episode, joints and disks of the same instant.

    Of a part towards one goal: what was seen until the next.
    """
    joints: dict[int, Float[ndarray, "J"]] = {}  # by time stamp [ns]
    scenes: dict[int, Scene] = {}
    namespace = bag.custom_data.get(NAMESPACE_KEY, "")
    for received in bag.messages(types=(JOINTS, SCENE)):
        if not received.topic.startswith(f"{namespace}/"):
            continue  # of another graph
        message = received.message
        stamp = decode_stamp(message.header.stamp)
        if received.type == JOINTS:
            joints[stamp] = np.array(message.position, dtype=np.float64)
        elif _is_of(message, received.log_time, episode):
            scenes[stamp] = decode_disks(message.disks)
    return [
        Moment(1e-9 * stamp, joints[stamp], scene, judged)
        for stamp, scene in sorted(scenes.items())
        if stamp in joints and (judged := episode.judge(scene)) is not None
    ]


def _is_of(scene: Any, log_time: int, episode: Episode) -> bool:
    first, last = episode.interval
    return bool(scene.episode_id == episode.episode_id and first <= log_time <= last)


def choose_moments(moments: Sequence[Moment]) -> list[Moment]:
    """Return the moments to show: evenly spaced in simulated time, the last one included."""
    if not moments:
        return []
    times = np.array([moment.time for moment in moments])
    span = times[-1] - times[0]
    step = max(SPEED / RATE, span / (LONGEST - 1))
    wanted = np.append(np.arange(times[0], times[-1], step), times[-1])
    nearest = np.searchsorted(times, wanted - 1e-9)
    return [moments[index] for index in dict.fromkeys(nearest.tolist())]


def render(
    renderer: "Renderer", moments: Sequence[Moment], goal: Points, title: str
) -> list[Image.Image]:
    """Return the pictures of moments, with the outline (C, 2) [m] of a goal and a title."""
    return [
        _caption(renderer.picture(one.joints, one.scene, goal), title, one.judged)
        for one in moments
    ]


def encode_gif(frames: Sequence[Image.Image]) -> bytes:
    """Return a film as an animated GIF, with one palette for all pictures: nothing flickers."""
    palette = _common_palette(frames, (PALETTE.success, PALETTE.goal, PALETTE.ink))
    first, *others = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    durations = [round(1000 / RATE)] * len(frames)  # [ms]
    durations[-1] += round(1000 * HOLD)
    memory, options = BytesIO(), {"duration": durations, "loop": 0, "optimize": True}
    first.save(memory, format="GIF", save_all=True, append_images=others, **options)
    return memory.getvalue()


def _common_palette(frames: Sequence[Image.Image], rare: Sequence[str]) -> Image.Image:
    """Return a palette that has some colours in any case: of too few pixels to count."""
    picked = [frames[i] for i in np.linspace(0, len(frames) - 1, SAMPLES).astype(int)]
    width, height = picked[0].size
    sheet = Image.new("RGB", (width, height * len(picked) + len(rare) * SWATCH))
    for place, frame in enumerate(picked):
        sheet.paste(frame, (0, place * height))
    for place, colour in enumerate(rare):
        top = height * len(picked) + place * SWATCH
        sheet.paste(colour, (0, top, width, top + SWATCH))
    return sheet.quantize(256, method=Image.Quantize.MEDIANCUT)


def _caption(picture: Picture, title: str, judged: Judgement) -> Image.Image:
    """Return a picture with the title and the distance to the goal [m] written on it."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    size = max(12, image.width // 24)
    font, colour = ImageFont.load_default(size), PALETTE.success if judged.met else PALETTE.ink
    text = f"{title}: {1e3 * judged.distance:.0f} mm from the goal"
    draw.text((image.width / 2, image.height - MARGIN), text, colour, font, anchor="ms")
    return image
