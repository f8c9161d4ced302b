"""A short moving picture of one episode, replayed from its recording.

The arm's joints and the disks come from the bag and nothing is simulated again: what is shown
is what happened.
"""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import BytesIO
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from PIL import Image, ImageDraw, ImageFont

from sain_bags.reading.reader import Bag
from sain_bags.rows.episodes import Episode
from sain_bags.rows.topics import SCENE
from sain_bringup.graph import NAMESPACE_KEY
from sain_core.camera.image_camera import ImageCameraConfig
from sain_core.goal import Goal, Judgement
from sain_core.scene import POSE, unit
from sain_core.shapes.bodies import Bodies
from sain_core.types import Points, Scene
from sain_core.view.palette import PALETTE
from sain_core.view.scenes import goal_marks
from sain_core.wire import decode_disks, decode_pose, decode_stamp

if TYPE_CHECKING:
    from sain_sim.camera.renderer import Renderer  # takes a second to load

JOINTS: Final = "sensor_msgs/msg/JointState"
TRUTH: Final = "truth"  # topic of simulated poses, for those who watch: nodes do not read it
MARGIN: Final = 16  # [px]
SPEED: Final = 3.0  # simulated time by shown time
RATE: Final = 12.0  # [Hz], of pictures
HOLD: Final = 2.0  # [s] that the last picture stands
CAMERA: Final = ImageCameraConfig(  # where the arm rarely hides the target or the goal
    width=480, height=360, eye=(1.75, -0.5, 1.2), focus=(0.42, 0.02, 0.16), field_of_view=36.0
)
LONGEST: Final = 60  # pictures at most; a longer episode is shown faster
COLOURS: Final = 256
SAMPLES: Final = 8  # pictures that the common palette is made from
SWATCH: Final = 40  # [px], rows that a rare colour gets in the sheet for the palette
CORNERS: Final = 72  # of a ring
LEAST_TEXT: Final = 18  # [px]


Words = Sequence[tuple[str, str]]  # texts and their colours
Describe = Callable[["Moment"], Words]


@dataclass(frozen=True)
class Moment:
    """The world at one time."""

    time: float  # [s], by the stamps of the messages
    joints: Float[ndarray, "J"]  # [rad]
    scene: Scene  # (N, 8)
    judged: Judgement  # how far the last scene was from the goal
    settled: bool  # whether it was
    since: float  # [s], received so long after the goal


class _Sight(NamedTuple):
    """Bodies at one time, and the last scene of them."""

    stamp: int  # [ns]
    log_time: int  # [ns since the epoch], received
    message: Any  # sain_interfaces/msg/Scene
    seen: Scene  # (N, 8), of that
    scene: Scene  # (N, 8), where the bodies were


def episode_moments(bag: Bag, *parts: Episode) -> list[Moment]:
    """Return everything that was seen in episodes or parts of them, with the joints of that time.

    Bodies are where the simulator states them, if the bag has that; else as in the scenes. Of a
    part towards one goal: what was seen until the next.
    """
    joints, sights = _replay(bag)
    stamps, moments = sorted(joints), list[Moment]()
    for sight in sorted(sights, key=attrgetter("stamp")):
        before = bisect_right(stamps, sight.stamp)
        for part in parts if before else ():
            first, last = part.interval
            is_of = sight.message.episode_id == part.episode_id and first <= sight.log_time <= last
            if is_of and (judged := part.judge(sight.seen)) is not None:
                placed = joints[stamps[before - 1]], sight.scene
                since = 1e-9 * (sight.log_time - first)
                settled = sight.message.settled
                moments.append(Moment(1e-9 * sight.stamp, *placed, judged, settled, since))
    return moments


def _replay(bag: Bag) -> tuple[dict[int, Float[ndarray, "J"]], list[_Sight]]:
    """Return joints by their time stamps [ns], and the bodies, as they were received."""
    joints, sights = dict[int, Float[ndarray, "J"]](), list[_Sight]()
    graph = bag.custom_data.get(NAMESPACE_KEY, "") + "/"
    topics = {topic.name: topic.type for topic in bag.topics if topic.name.startswith(graph)}
    truths = {name for name in topics if name.endswith(f"/{TRUTH}")}
    wanted = truths | {name for name, kind in topics.items() if kind in (JOINTS, SCENE)}
    last: Any = None
    seen, scene, at = np.empty((0, 8)), np.empty((0, 8)), 0
    for received in bag.messages(wanted):
        message, stamp = received.message, decode_stamp(received.message.header.stamp)
        if received.type == JOINTS:
            joints[stamp] = np.array(message.position, dtype=np.float64)
            continue
        if received.type == SCENE:
            last, seen = message, decode_disks(message.disks)
            at, scene = (at, scene) if truths else (stamp, seen)
        elif last is not None:
            at, scene = stamp, seen.copy()
            scene[:, POSE] = [decode_pose(pose, "a true pose") for pose in message.poses]
        if at:
            sights.append(_Sight(at, received.log_time, last, seen, scene))
    return joints, sights


def choose_moments(
    moments: Sequence[Moment], speed: float = SPEED, rate: float = RATE, most: int = LONGEST
) -> list[Moment]:
    """Return the moments to show: evenly spaced in time, the last one included.

    Args:
        moments: of which.
        speed: of their time by the shown one; larger where there would be too many.
        rate: of pictures [Hz].
        most: moments that are shown.
    """
    if not moments:
        return []
    times = np.array([moment.time for moment in moments])
    span = times[-1] - times[0]
    step = max(speed / rate, span / (most - 1))
    nearest = np.searchsorted(times, np.arange(times[0], times[-1], step) - 1e-9)
    return [moments[index] for index in dict.fromkeys([*nearest.tolist(), len(moments) - 1])]


def render(
    renderer: "Renderer", bodies: Bodies, moments: Sequence[Moment], describe: Describe
) -> list[Image.Image]:
    """Return the pictures of moments, with the goals of bodies, each with words under it."""
    frames = []
    for one in moments:
        goals = goal_outlines(one.judged.goal, one.scene, bodies)
        frames.append(Image.fromarray(renderer.picture(one.joints, one.scene, goals)))
        write_words(frames[-1], describe(one))
    return frames


def goal_outlines(goal: Goal, scene: Scene, bodies: Bodies) -> list[Points]:
    """Return outlines (C, 2) [m] of where bodies (N, 8) should lie.

    Where a heading does not count, it is a ring in which the body lies wholly.
    """
    ring = unit(np.linspace(0.0, 2 * np.pi, CORNERS))
    return [
        mark.body.outline
        if mark.body.marked
        else mark.body.place + (mark.body.radius + mark.tolerance) * ring
        for mark in goal_marks(goal, scene, bodies)
    ]


def write_words(image: Image.Image, words: Words, line: int = 0) -> None:
    """Write words side by side in the middle of an image, on a line that counts from below."""
    draw, size = ImageDraw.Draw(image), max(LEAST_TEXT, image.width // 24)
    font, baseline = ImageFont.load_default(size), image.height - MARGIN - 1.25 * size * line
    widths = [draw.textlength(text, font) for text, _ in words]
    left = (image.width - sum(widths)) / 2
    for (text, colour), width in zip(words, widths, strict=True):
        draw.text((left, baseline), text, colour, font, anchor="ls")
        left += width


def describe_distance(title: str, one: Moment) -> Words:
    """Return a title and the distance to the goal."""
    colour = PALETTE.success if one.judged.met else PALETTE.ink
    return ((f"{title}: {1e3 * one.judged.distance:.0f} mm from the goal", colour),)


def encode_gif(frames: Sequence[Image.Image], rate: float = RATE, colours: int = COLOURS) -> bytes:
    """Return a film as an animated GIF with so many pictures per second [Hz].

    All pictures have one palette, so that nothing flickers; fewer colours make a smaller file.
    """
    palette = _common_palette(frames, colours, (PALETTE.success, PALETTE.goal, PALETTE.ink))
    first, *others = (frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames)
    durations = [round(1000 / rate)] * len(frames)  # [ms]
    durations[-1] += round(1000 * HOLD)
    memory, options = BytesIO(), {"duration": durations, "loop": 0, "optimize": True}
    first.save(memory, format="GIF", save_all=True, append_images=others, **options)
    return memory.getvalue()


def _common_palette(
    frames: Sequence[Image.Image], colours: int, rare: Sequence[str]
) -> Image.Image:
    """Return a palette that has some colours in any case: of too few pixels to count."""
    picked = [frames[i] for i in np.linspace(0, len(frames) - 1, SAMPLES).astype(int)]
    width, height = picked[0].size
    sheet = Image.new("RGB", (width, height * len(picked) + len(rare) * SWATCH))
    for place, frame in enumerate(picked):
        sheet.paste(frame, (0, place * height))
    for place, colour in enumerate(rare):
        top = height * len(picked) + place * SWATCH
        sheet.paste(colour, (0, top, width, top + SWATCH))
    return sheet.quantize(colours, method=Image.Quantize.MEDIANCUT)
