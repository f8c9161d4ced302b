"""A short moving picture of one episode, replayed from its recording.

The arm's joints and the disks come from the bag and nothing is simulated again: what is shown
is what happened.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray
from PIL import Image, ImageDraw, ImageFont

from sain_bags.reading.reader import Bag
from sain_bags.rows.episodes import Episode
from sain_bags.rows.topics import SCENE
from sain_bringup.graph import NAMESPACE_KEY
from sain_core.config import Config, option
from sain_core.goal import Judgement
from sain_core.types import Points, Scene
from sain_core.view.film import gif_of
from sain_core.view.palette import PALETTE
from sain_core.wire import decode_disks, decode_stamp
from sain_core.workers import FunctionRunner, Software, Work, start_processes

if TYPE_CHECKING:
    from sain_sim.camera.render import Renderer  # takes a second to load

JOINTS: Final = "sensor_msgs/msg/JointState"
MARGIN: Final = 16  # [px]
MOST_PROCESSES: Final = 8
VIEWS: Final = 3  # cameras that are tried until one shows target and goal in every picture

Picture = UInt8[ndarray, "height width 3"]


@dataclass(frozen=True)
class MovieConfig(Config):
    """How a recording becomes a moving picture."""

    speed: float = option(3.0, "simulated time by shown time", minimum=0.1, maximum=100.0)
    rate: float = option(12.0, "pictures a second", unit="Hz", minimum=1.0, maximum=50.0)
    hold: float = option(2.0, "the last picture stands", unit="s", minimum=0.0, maximum=20.0)
    width: int = option(480, "of a picture", unit="px", minimum=64, maximum=1920)
    height: int = option(360, "of a picture", unit="px", minimum=64, maximum=1080)
    colours: int = option(256, "in the palette", minimum=8, maximum=256)
    longest: int = option(60, "pictures at most; a longer episode is shown faster", minimum=2)


@dataclass(frozen=True)
class Moment:
    """The world at one time."""

    time: float  # [s], simulated
    joints: Float[ndarray, "7"]  # [rad]
    scene: Scene  # (N, 8)
    judged: Judgement  # how far it is from the goal


def episode_moments(bag: Bag, episode: Episode) -> list[Moment]:
    """Return everything that was seen of an episode, joints and disks of the same instant.

    Of a part towards one goal: what was seen until the next.
    """
    joints: dict[int, Float[ndarray, "7"]] = {}  # by time stamp [ns]
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


def choose_moments(moments: Sequence[Moment], config: MovieConfig) -> list[Moment]:
    """Return the moments to show: evenly spaced in simulated time, the last one included."""
    if not moments:
        return []
    times = np.array([moment.time for moment in moments])
    span = times[-1] - times[0]
    step = max(config.speed / config.rate, span / (config.longest - 1))
    wanted = np.append(np.arange(times[0], times[-1], step), times[-1])
    nearest = np.searchsorted(times, wanted - 1e-9)
    return [moments[index] for index in dict.fromkeys(nearest.tolist())]


@dataclass(frozen=True)
class Scenery:
    """What all pictures of a film have in common."""

    start: Scene  # (N, 8)
    shapes: tuple[str, ...] | None
    outline: Points | None  # (C, 2) [m], of the first body in its goal; None: a ring is drawn
    goal: Points  # (2,) [m]
    ring: float  # [m], radius
    title: str  # on each picture
    config: MovieConfig

    def renderer(self) -> "Renderer":
        """Return what renders the pictures."""
        from sain_sim.camera.render import CameraConfig, Renderer

        camera = CameraConfig(width=self.config.width, height=self.config.height)
        renderer = Renderer(self.start, self.shapes, camera)
        if self.outline is not None:
            renderer.mark_goal(self.outline)
        return renderer


class FilmPart(NamedTuple):
    """Moments of a film, seen from one place.

    Attributes:
        whatever: pictures that hide the target or the goal count, too.
    """

    moments: Sequence[Moment]
    eye: Float[ndarray, "3"]  # [m]
    whatever: bool


def render(scenery: Scenery, part: FilmPart) -> list[Image.Image] | None:
    """Return the pictures of a part; None where one hides the target or the goal."""
    frames = []
    with scenery.renderer() as renderer:
        renderer.look_from(part.eye)
        for moment in part.moments:
            picture = renderer.picture(moment.joints, moment.scene, scenery.goal, scenery.ring)
            if not (part.whatever or all(renderer.pixels)):
                return None
            frames.append(_caption(picture, scenery.title, moment.judged))
    return frames


class Film:
    """The pictures of an episode, rendered on all cores as soon as this is made.

    The camera stands where no picture hides the target or the goal, or else in the best place.
    """

    def __init__(self, scenery: Scenery, moments: Sequence[Moment], processes: int = 0) -> None:
        """Begin to render in so many processes; 0: one for each core."""
        with scenery.renderer() as renderer:
            seen = [(moment.joints, moment.scene) for moment in moments]
            eyes = renderer.eyes(seen, scenery.goal, scenery.ring)
        self._views = [*((eye, False) for eye in eyes[:VIEWS]), (eyes[0], True)]
        size = min(processes or len(os.sched_getaffinity(0)), MOST_PROCESSES, len(moments))
        ends = np.linspace(0, len(moments), size + 1).astype(int).tolist()
        self._parts = [moments[first:last] for first, last in pairwise(ends)]
        start = partial(FunctionRunner, partial(render, scenery))
        self._work = Work(start, Software((), ()))  # there is nothing that pictures must agree with
        self._begin()

    def _begin(self) -> None:
        eye, whatever = self._views.pop(0)
        parts = [FilmPart(moments, eye, whatever) for moments in self._parts]
        self._pictures = start_processes(self._work, parts, len(parts))

    def frames(self) -> list[Image.Image]:
        """Wait for the pictures and return them."""
        while True:
            parts = list(self._pictures)
            if None not in parts:
                return [frame for part in parts if part is not None for frame in part]
            self._begin()  # from the next place; from the last one, all pictures count

    def close(self) -> None:
        """End the processes, also in the middle of the work."""
        self._pictures.close()


def encode_gif(frames: Sequence[Image.Image], config: MovieConfig) -> bytes:
    """Return the film as an animated GIF."""
    rare = (PALETTE.success, PALETTE.goal, PALETTE.ink)
    return gif_of(frames, config.rate, config.hold, config.colours, rare)


def _caption(picture: Picture, title: str, judged: Judgement) -> Image.Image:
    """Return a picture with the title and the distance to the goal [m] written on it."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    size = max(12, image.width // 24)
    font, colour = ImageFont.load_default(size), PALETTE.success if judged.met else PALETTE.ink
    text = f"{title}: {1e3 * judged.distance:.0f} mm from the goal"
    draw.text((image.width / 2, image.height - MARGIN), text, colour, font, anchor="ms")
    return image
