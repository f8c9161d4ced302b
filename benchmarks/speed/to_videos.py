"""How fast a bag with images becomes a LeRobot data set, beside `rosbags` and LeRobot's writer.

`to_dataset` checks the messages, makes all columns, and encodes the last image before each push.
The other one decodes the same bag with `rosbags`, takes the same images, the states, the actions
and the states after them, and hands them to `LeRobotDataset.add_frame` and `save_episode`: the same
codec with the same settings, by way of PNG files. In turns, the shortest time of some.
"""

import shutil
import tempfile
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader

from benchmarks.report import Figure, ReportOptions, read_options, report
from benchmarks.speed.made_bags import IMAGE, MadeBag
from benchmarks.timing import fastest
from sain_bags.dataset.conversion import convert
from sain_bags.dataset.rows import ConversionConfig
from sain_core.pretrained import LeRobotDataset
from sain_core.push import PUSH_NAMES
from sain_core.scene import STATE_NAMES

KEY = "observation.images.camera_color"


@dataclass(frozen=True)
class Options(ReportOptions):
    """What to measure."""

    pushes: int = 80
    """in the bag, eight an episode"""
    images: int = 15
    """before each push"""
    width: int = 640
    height: int = 480
    repeats: int = 3
    """of each, of which the fastest counts"""


def make_bag(folder: Path, options: Options) -> None:
    """Write a bag of pushes, and of images in which a square moves before a background."""
    bag, random = MadeBag(folder), np.random.default_rng(0)
    coarse = random.integers(60, 190, (options.height // 20, options.width // 20, 3), np.uint8)
    background = np.kron(coarse, np.ones((20, 20, 1), np.uint8))
    for number in range(1, options.pushes + 1):
        shown = []
        for _ in range(options.images):
            image = background + random.integers(0, 4, background.shape, np.uint8)
            x, y = random.integers(0, options.height - 60, 2)
            image[y : y + 60, x : x + 60] = 230
            shown.append(image)
        bag.images(shown)
        bag.pushes(1, first=number)
    bag.writer.close()


def with_sain(bag: Path, out: Path) -> int:
    """Convert a bag; return how many frames."""
    shutil.rmtree(out, ignore_errors=True)
    return convert([bag], out, ConversionConfig(format="lerobot")).transitions


def with_rosbags(bag: Path, out: Path, shape: tuple[int, int, int]) -> int:
    """Convert a bag; return how many frames."""
    shutil.rmtree(out, ignore_errors=True)
    numbers = {"observation.state": 16, "next.state": 16, "action": 5}
    features: dict[str, Any] = {
        key: {"dtype": "float64", "shape": (size,), "names": None} for key, size in numbers.items()
    }
    features[KEY] = {"dtype": "video", "shape": shape, "names": ["height", "width", "channels"]}
    data = LeRobotDataset.create("bag", 1, features, root=out, video_backend="pyav")
    image: Any = None
    seen: dict[int, Any] = {}
    episode, frames = 0, 0
    with AnyReader([bag]) as reader:
        for connection, _, raw in reader.messages():
            message: Any = reader.deserialize(raw, connection.msgtype)
            if connection.msgtype == IMAGE:
                image = message.data.reshape(message.height, message.width, 3)
            elif connection.topic == "/sain/push":
                seen[message.push_id] = image
            elif connection.topic == "/sain/push_result":
                if frames and message.episode_id != episode:
                    data.save_episode()
                episode, frames = message.episode_id, frames + 1
                data.add_frame(
                    {
                        "observation.state": state(message.before),
                        "next.state": state(message.after),
                        "action": np.array([getattr(message.push, name) for name in PUSH_NAMES])
                        * 1.0,
                        KEY: seen.pop(message.push_id),
                        "task": "push",
                    }
                )
    data.save_episode()
    data.finalize()
    return frames


def state(scene: Any) -> np.ndarray:
    """Return the numbers of a scene (16,)."""
    return np.array([getattr(disk, name) for disk in scene.disks for name in STATE_NAMES])


def action(push: Any) -> np.ndarray:
    """Return the numbers of a push (5,)."""
    return np.array([getattr(push, name) for name in PUSH_NAMES], dtype=np.float64)


def main() -> None:
    """Run from the command line."""
    options = read_options(Options, __doc__)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make_bag(folder / "bag", options)
        shape = options.height, options.width, 3
        works = {
            "to_dataset": partial(with_sain, folder / "bag", folder / "sain"),
            "rosbags and LeRobot's writer": partial(
                with_rosbags, folder / "bag", folder / "rosbags", shape
            ),
        }
        times = fastest(works, options.repeats)
    figures = [
        Figure(who, 1e3 * time.wall / options.pushes, "ms/push") for who, time in times.items()
    ]
    own, other = times.values()
    figures.append(Figure("ratio of the times", other.wall / own.wall, "x", at_least=2.0))
    figures.append(Figure("ratio of processor time", other.processor / own.processor, "x"))
    report("A bag with images to LeRobot", figures, options.out)


if __name__ == "__main__":
    main()
