"""Write episodes of our agent as a LeRobot data set: images, states, pushes and rewards.

./env python examples/07_demonstrations_for_lerobot.py [FOLDER] [EPISODES]
"""

import sys
import warnings
from pathlib import Path
from tempfile import TemporaryDirectory

import gymnasium
import numpy as np
from PIL import Image

from sain_bags.dataset.formats.to_lerobot import LeRobotDataset, SuppressProgressBars
from sain_core.push import PUSH_NAMES
from sain_gym import AgentPolicy

FOLDER = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("demonstrations")
EPISODES = int(sys.argv[2]) if len(sys.argv) > 2 else 3
FRAMES_A_SECOND = 1  # a frame is a push
TASK = "Push the orange disk into the green ring with the blue disk."
IMAGE, STATE, ACTION = "observation.image", "observation.state", "action"
Frames = dict[str, list]

env = gymnasium.make("sain/Push-v0", scenario="anywhere", observation="image")
world = env.unwrapped
agent = AgentPolicy(env)


def demonstrate(seed: int) -> Frames:
    """Return the frames of one episode: what was seen and done, and what it brought."""
    keys = (IMAGE, STATE, ACTION, "next.reward", "next.success", "next.done")
    frames: Frames = {key: [] for key in keys}
    (image, info), over = env.reset(seed=seed), False
    while not over:
        state, push = world.scene.ravel(), agent(image, info)
        seen = image
        image, reward, terminated, truncated, info = env.step(push)
        over = terminated or truncated
        row = (seen, state, push, reward, info["is_success"], over)
        for key, value in zip(keys, row, strict=True):
            frames[key].append(value)
    return frames


def save(dataset: LeRobotDataset, frames: Frames, folder: Path) -> None:
    """Add an episode to the data set; its images are files until they are part of it."""
    count = len(frames[ACTION])
    paths = [folder / f"{dataset.num_episodes}-{index}.png" for index in range(count)]
    for path, image in zip(paths, frames[IMAGE], strict=True):
        Image.fromarray(image).save(path)
    episode = dataset.create_episode_buffer()
    for key, values in frames.items():
        kind = dataset.features[key]["dtype"]
        episode[key] = [str(p) for p in paths] if key == IMAGE else list(np.array(values, kind))
    episode |= {"frame_index": list(range(count)), "size": count, "task": [TASK] * count}
    episode["timestamp"] = [index / FRAMES_A_SECOND for index in range(count)]
    with warnings.catch_warnings(action="ignore", category=RuntimeWarning):  # means of truths
        dataset.save_episode(episode)


size, actions = world.config.image_size, env.action_space.shape
features = {
    IMAGE: {"dtype": "image", "shape": (size, size, 3), "names": ["height", "width", "channels"]},
    STATE: {"dtype": "float32", "shape": (16,), "names": None},
    ACTION: {"dtype": "float32", "shape": actions, "names": list(PUSH_NAMES)},
    "next.reward": {"dtype": "float32", "shape": (1,), "names": None},
    "next.success": {"dtype": "bool", "shape": (1,), "names": None},
    "next.done": {"dtype": "bool", "shape": (1,), "names": None},
}
dataset = LeRobotDataset.create(
    "sain/anywhere", FRAMES_A_SECOND, features, root=FOLDER, use_videos=False, video_backend="pyav"
)
with TemporaryDirectory() as images, SuppressProgressBars():
    for number in range(EPISODES):
        frames = demonstrate(seed=1_000_000 + number)
        save(dataset, frames, Path(images))
        ending = "reached" if frames["next.success"][-1] else "not reached"
        print(f"episode {number}: {len(frames[ACTION])} pushes, {ending}")
dataset.finalize()
env.close()

loaded = LeRobotDataset("sain/anywhere", root=FOLDER, video_backend="pyav")
frame = loaded[0]
print(f"{FOLDER}: {loaded.num_episodes} episodes, {loaded.num_frames} frames")
print(*(f"{key} {tuple(frame[key].shape)} {frame[key].dtype}" for key in features), sep="\n")
