"""Pushes of the project's own simulation in the form of real ones: shapes, surfaces, repeats."""

from pathlib import Path

import numpy as np

from sain_core.push import make_stroke
from sain_core.randomness import generator
from sain_core.scene import unit, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.storage import write_arrays
from sain_core.transitions import Column, shard_path
from sain_model.data.dataset import Dataset, load_dataset
from sain_model.physics.parameters import PlanarConfig
from sain_model.physics.planar import PlanarPrior

SHAPES = {"box_3x2": 0.07, "triangle": 0.08, "oval": 0.06}  # radius [m]
SURFACES = {"rubber": 0.3, "steel": 0.15}  # friction of the tool there
NOISE = 0.0005  # [m], and rad / 100


def write_pushes(folder: Path, count: int, seed: int = 0) -> Dataset:
    """Write so many pushes of each shape, each of them on every surface and twice on the first."""
    columns: dict[str, list[np.ndarray]] = {}
    group = 0
    for place, (name, radius) in enumerate(SHAPES.items()):
        scenes, strokes = _drawn(count, radius, generator(seed, name))
        groups = group + np.arange(count)
        group += count
        for repeat, surface in enumerate(["rubber", "rubber", "steel"]):
            random = generator(seed, name, surface, repeat)
            config = PlanarConfig(tool_friction=SURFACES[surface])
            prior = PlanarPrior(config).with_bodies(Bodies.named([f"{name}:flat"]))
            after = prior.step(scenes, strokes)
            moved = np.abs(after - scenes)[..., :3].sum(axis=-1, keepdims=True) > 1e-6
            after[..., :2] += moved * random.normal(0.0, NOISE, (count, 1, 2))
            after[..., 2:3] += moved * random.normal(0.0, 100 * NOISE, (count, 1, 1))
            rows = {
                Column.STATE: scenes.reshape(count, -1),
                Column.ACTION: strokes,
                Column.PHYSICS_NEXT: scenes.reshape(count, -1),
                Column.NEXT_STATE: after.reshape(count, -1),
                Column.EPISODE: groups,
                Column.STEP: np.full(count, repeat),
                Column.SHAPES: np.full(count, f"{name}:flat"),
                Column.SURFACE: np.full(count, surface),
                Column.OBJECT: np.full(count, name),
                Column.RUN: np.full(count, f"{place}"),
            }
            for column, values in rows.items():
                columns.setdefault(column, []).append(values)
    write_arrays(shard_path(folder, 0), {key: np.concatenate(v) for key, v in columns.items()})
    return load_dataset(folder)


def _drawn(count: int, radius: float, random: np.random.Generator):
    """Return scenes of one body, and strokes that mostly hit it."""
    scenes = np.zeros((count, 1, 8))
    scenes[:, 0, :2] = random.uniform(-0.1, 0.1, (count, 2))
    scenes[:, 0, 2] = random.uniform(-np.pi, np.pi, count)
    scenes[:, 0, 6:] = 0.8, radius
    heading = random.uniform(-np.pi, np.pi, count)
    aim = scenes[:, 0, :2] + random.uniform(-0.6, 0.6, (count, 2)) * radius
    start = aim - (radius + 0.02) * 1.6 * unit(heading)
    return scenes, make_stroke(start, wrap_angle(heading), 0.08, speed=0.02, tip_radius=0.005)
