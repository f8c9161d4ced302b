"""Episodes whose truth is the planar prior plus a residual that depends on nothing random."""

from pathlib import Path

import numpy as np

from sain_core.push import PushLimits
from sain_core.scene import POSITION, make_scene, unit
from sain_core.types import Pushes, Scenes
from sain_model.data.dataset import Part, Windows, load_dataset, make_windows
from sain_model.physics.planar import PlanarPrior

EPISODES, PUSHES = 16, 6
EVERY = np.arange(EPISODES * PUSHES)


def truth(scenes: Scenes, pushes: Pushes) -> Scenes:
    """Return the prior's prediction with whatever moved carried on by a tenth, and 2 mm to +y."""
    predicted = PlanarPrior().step(scenes, pushes)
    way = predicted[..., POSITION] - scenes[..., POSITION]
    moved = np.linalg.norm(way, axis=-1, keepdims=True) > 1e-3
    predicted[..., POSITION] += moved * (0.1 * way + np.array([0.0, 0.002]))
    return predicted


def make_episodes(folder: Path, kept: np.ndarray = EVERY) -> Path:
    """Write a shard of episodes of successive pushes: these rows, in this order."""
    random = np.random.default_rng(5)
    bearings = random.uniform(-np.pi, np.pi, EPISODES)
    targets = np.array([0.45, 0.0]) + 0.145 * unit(bearings)
    middle = np.array([0.45, 0.0])
    kinds = np.array([8.0, 8.0]), np.array([0.08, 0.06])
    scenes = np.stack([make_scene(np.stack([middle, target]), *kinds) for target in targets])
    rows = []
    for _ in range(PUSHES):
        pushes = PushLimits().sample(random, EPISODES)
        rows.append((scenes, pushes, PlanarPrior().step(scenes, pushes), truth(scenes, pushes)))
        scenes = rows[-1][3]
    arrays = [np.stack(part, axis=1) for part in zip(*rows, strict=True)]  # (episodes, pushes, ..)
    scenes, pushes, physics, after = (np.concatenate(part)[kept] for part in arrays)
    return write_shard(
        folder, scenes, pushes, after, physics, episode=kept // PUSHES, step=kept % PUSHES,
        friction=np.full(len(kept), 0.12),
    )  # fmt: skip


def write_shard(
    folder: Path, scenes: Scenes, pushes: Pushes, after: Scenes, physics: Scenes | None = None,
    number: int = 0, **more: np.ndarray,
) -> Path:  # fmt: skip
    """Write transitions as a shard; without what physics predicts, nothing moves."""
    known = {"state": scenes, "next_state": after}
    known["physics_next"] = scenes if physics is None else physics
    flat = {name: some.reshape(len(some), -1) for name, some in known.items()}
    folder.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(folder / f"shard-{number}.npz", action=pushes, **flat, **more)
    return folder


def load_episodes(folder: Path, kept: np.ndarray = EVERY) -> Part:
    """Return what `make_episodes` writes."""
    return load_dataset(make_episodes(folder, kept)).alike


def whole_windows(data: Part, steps: int) -> Windows:
    """Return the windows of all of so many pushes."""
    windows = make_windows(data, steps)
    return windows.select(windows.known.all(axis=1))
