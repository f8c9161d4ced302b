"""What an episode starts from: the disks, their parameters and where they stand."""

from dataclasses import replace
from typing import Final

import numpy as np

from sain_core.errors import InvalidInputError, OutOfRangeError
from sain_core.scene import MASS, RADIUS, VELOCITY
from sain_core.seeding import generator
from sain_core.types import Scene
from sain_sim.episodes.truth import ALL, TRUTHS, TruthConfig
from sain_sim.world.parameters import (
    CUBE,
    THREE_FEET,
    WorldParameters,
    nominal_parameters,
)

NOMINAL: Final = "nominal"
WORLDS: Final = (*TRUTHS, NOMINAL)
DISK: Final = "disk"
START: Final = (0.35, 0.0)  # [m], the mid disk in the paper's scene
GAP: Final = 0.001  # [m], between mid disk and target in the paper's scene


def draw_episode(
    seed: int,
    world: str,
    scene: Scene | None = None,
    shapes: tuple[str, ...] = (),
    friction: float = 0.0,
    disk_shape: str = THREE_FEET,
    lab: int = 0,
    effects: str = ALL,
) -> tuple[WorldParameters, Scene]:
    """Return what an episode is made of; what is not given is drawn from the seed.

    Args:
        seed: same seed, same episode.
        world: one of `WORLDS`.
        scene: (N, 8), its velocities are ignored; the paper's start with two disks if None.
        shapes: "disk" or "cube", one for each disk; none: all disks.
        friction: with the table; 0: as the world has it.
        disk_shape: how a disk is built, "three_feet" or "flat".
        lab: which rough world.
        effects: what is rough there, as `TruthConfig` has it.

    Raises:
        InvalidInputError: a world or shape that does not exist, or too few or many shapes.
        OutOfRangeError: a friction that is negative.
        ConfigError: an effect that does not exist, or feet to be moved on a flat disk.
    """
    if world not in WORLDS:
        raise InvalidInputError(f"world is {world!r}; allowed: {', '.join(WORLDS)}")
    if not friction >= 0.0:
        raise OutOfRangeError(f"friction is {friction}; it must be positive, or 0 to have it drawn")
    count = 2 if scene is None else len(scene)
    built = _built(shapes, count, disk_shape)
    if world == NOMINAL:
        parameters = nominal_parameters(count)
    else:
        parameters = TruthConfig(world, effects, lab).draw(generator(seed, "episode"), count)
    parameters = replace(parameters, shapes=built, friction=friction or parameters.friction)
    if scene is None:
        return parameters, paper_start(parameters)
    masses, radii = tuple(scene[:, MASS].tolist()), tuple(scene[:, RADIUS].tolist())
    resting = scene.copy()
    resting[:, VELOCITY] = 0.0
    return replace(parameters, masses=masses, radii=radii), resting


def paper_start(parameters: WorldParameters) -> Scene:
    """Return the paper's start (2, 8): the target behind the mid disk, all but touching."""
    x, y = START
    target_x = x + parameters.radii[0] + GAP + parameters.radii[1]
    return parameters.scene(np.array([(x, y), (target_x, y)]))


def _built(shapes: tuple[str, ...], count: int, disk_shape: str) -> tuple[str, ...]:
    if len(shapes) not in (0, count):
        raise InvalidInputError(f"{len(shapes)} shapes are given for {count} disks")
    known = {DISK: disk_shape, CUBE: CUBE}
    for shape in shapes:
        if shape not in known:
            raise InvalidInputError(f"shape is {shape!r}; allowed: {', '.join(known)}")
    return tuple(known[shape] for shape in shapes or (DISK,) * count)
