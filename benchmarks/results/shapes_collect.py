"""Pushes of the whole library of shapes, in the randomised world, to learn from.

    ./env python -m benchmarks.results.shapes_collect data/any --episodes 3000

Every fourth shape is unseen: it is in no episode that is learned from. Episodes are written in
chunks; a second call goes on behind the last chunk.
"""

import argparse
import time
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
from shapely import Polygon

from sain_core.errors import SainError
from sain_core.push import PushLimits, make_push, strokes
from sain_core.randomness import generator
from sain_core.scene import POSITION, unit
from sain_core.shapes import library
from sain_core.shapes.library import get_shape
from sain_core.shapes.solids import DISK
from sain_core.types import PushArray, Scene
from sain_sim.world.parameters import FRICTION_RANGE, MASS_RANGE, WorldParameters
from sain_sim.world.start import X_RANGE, Y_RANGE, wholly_on
from sain_sim.world.world import World, WorldConfig

NAMES = tuple(shape.name for shape in library.library())
UNSEEN = NAMES[3::4]
SEEN = (*(name for name in NAMES if name not in UNSEEN), DISK)
RADII_ALONE, RADII_TWO = (0.09, 0.11), (0.06, 0.08)  # [m], circumscribed
DISK_SHARE = 0.75  # of those: a disk is wider than anything else of its radius
PUSHES = 8  # of an episode
TRIES = 60  # draws for each
SHORTEST = 0.02  # [m]
TOUCHING, GAP = 0.5, 0.04  # share of the second bodies that touch; largest gap of the others [m]
AIMED, AIM = 0.6, 0.6  # share of pushes aimed at the other body, within this angle [rad]
CHUNK = 20  # episodes in a file


def main() -> None:
    """Collect; see the module."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--episodes", type=int, default=900)
    parser.add_argument("--seed", type=int, default=5)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    world: World | None = None
    start, total = time.monotonic(), 0
    for first in range(0, arguments.episodes, CHUNK):
        path = arguments.out / f"chunk-{first:05d}.npz"
        if path.exists():
            continue
        rows: list[dict[str, Any]] = []
        for number in range(first, first + CHUNK):
            random = generator(arguments.seed, "episode", number)
            unseen, parameters, scene = draw_episode(random, number)
            if world is None:
                world = World(parameters)
            world.reset(scene, parameters)
            rows += run_episode(random, world, number, unseen)
        total += len(rows)
        write(path, rows)
        rate = total / (time.monotonic() - start)
        print(f"{first + CHUNK} episodes, {total} pushes, {rate:.2f} pushes/s", flush=True)


def draw_episode(random: np.random.Generator, number: int) -> tuple[bool, WorldParameters, Scene]:
    """Draw bodies and start: one in six is of shapes that nobody learns from, which it tells."""
    unseen = number // 3 % 6 == 5
    names = tuple(random.choice(UNSEEN if unseen else SEEN, size=1 + int(random.uniform() < 0.5)))
    names = tuple(str(name) for name in names)
    while True:
        low, high = RADII_ALONE if len(names) == 1 else RADII_TWO
        radii = tuple(
            float(random.uniform(low, high)) * (DISK_SHARE if get_shape(name).is_round else 1.0)
            for name in names
        )
        parameters = WorldParameters(
            masses=tuple(random.uniform(*MASS_RANGE, len(names)).tolist()),
            radii=radii,
            shapes=names,
            friction=float(random.uniform(*FRICTION_RANGE)),
            roles=("pushable",) * len(names),
        )
        scene = draw_start(random, parameters)
        if scene is not None:
            return unseen, parameters, scene


def draw_start(random: np.random.Generator, parameters: WorldParameters) -> Scene | None:
    """Draw where the bodies stand; the second one slides along a bearing up to a gap."""
    count = parameters.count
    headings = random.uniform(-pi, pi, count)
    first = np.array([random.uniform(*X_RANGE), random.uniform(*Y_RANGE)])
    places = [first]
    if count == 2:
        gap = 1e-4 if random.uniform() < TOUCHING else random.uniform(0.0, GAP)
        way = unit(np.asarray(random.uniform(-pi, pi)))
        low, high = 0.0, sum(parameters.radii) + GAP
        for _ in range(30):
            middle = (low + high) / 2
            scene = parameters.scene(np.stack([first, first + middle * way]), headings)
            rings = [
                Polygon(shape.placed(state))
                for shape, state in zip(parameters.body_shapes, scene, strict=True)
            ]
            low, high = (low, middle) if rings[0].distance(rings[1]) >= gap else (middle, high)
        places.append(first + high * way)
    scene = parameters.scene(np.stack(places), headings)
    if not wholly_on(scene, WorldConfig().feasibility.table):
        return None
    return scene


def run_episode(
    random: np.random.Generator, world: World, number: int, unseen: bool
) -> list[dict[str, Any]]:
    """Push until there are enough, none is possible, or a body leaves the table."""
    rows: list[dict[str, Any]] = []
    parameters = world.parameters
    for step in range(PUSHES):
        outcome = None
        for _ in range(TRIES):
            push = draw_push(random, world.observe(), parameters)
            try:
                outcome = world.push(push)
                break
            except SainError:
                continue
        if outcome is None or not outcome.settled:
            break
        if not wholly_on(outcome.after, world.config.feasibility.table):
            break
        rows.append(
            {
                "state": padded(outcome.before),
                "action": push,
                "next_state": padded(outcome.after),
                "episode": number,
                "step": step,
                "friction": parameters.friction,
                "unseen": unseen,
                "shapes": np.array([*parameters.shapes, ""][:2]),
            }
        )
    return rows


def draw_push(random: np.random.Generator, scene: Scene, parameters: WorldParameters) -> PushArray:
    """Draw a push (5,) uniform along an outline; many of them roughly towards the other body."""
    limits = PushLimits()
    body = int(random.integers(len(scene)))
    aimed = len(scene) == 2 and random.uniform() < AIMED
    while True:
        push = make_push(
            -random.uniform(-pi, pi),
            random.uniform(-limits.max_angle, limits.max_angle),
            random.uniform(SHORTEST, limits.max_length),
            body=body,
        )
        if not aimed:
            return push
        heading = float(strokes(scene, push, limits, parameters.bodies)[1])
        way = scene[1 - body, POSITION] - scene[body, POSITION]
        off = heading - np.arctan2(way[1], way[0])
        if np.cos(off) > np.cos(AIM):
            return push


def padded(scene: Scene) -> Scene:
    """Return a scene with two rows; one that is missing is NaN."""
    return np.concatenate([scene, np.full((2 - len(scene), scene.shape[1]), np.nan)])


def write(path: Path, rows: list[dict[str, Any]]) -> None:
    """Write a chunk, whole or not at all."""
    columns: dict[str, Any] = {
        name: np.stack([np.asarray(row[name]) for row in rows]) for name in rows[0]
    }
    part = path.with_suffix(".part.npz")
    np.savez_compressed(part, **columns)
    part.rename(path)


if __name__ == "__main__":
    main()
