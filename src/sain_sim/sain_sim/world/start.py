"""What an episode starts from: the disks, their parameters and where they stand."""

from dataclasses import replace
from itertools import combinations
from math import pi
from typing import Final

import numpy as np
from shapely import Polygon

from sain_core.errors import ConfigError, InvalidInputError, OutOfRangeError
from sain_core.guarding.untrusted import MOST_BODIES
from sain_core.randomness import generator
from sain_core.scene import (
    MASS,
    MID,
    POSITION,
    RADIUS,
    TARGET,
    VELOCITY,
    Table,
    surface_gaps,
    unit,
)
from sain_core.shapes.library import check_shapes
from sain_core.shapes.solids import DISK
from sain_core.types import Scalars, Scene
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.truth import TruthConfig

START: Final = (0.35, 0.0)  # [m], the mid disk in the paper's scene
GAP: Final = 0.001  # [m], between mid disk and target in the paper's scene
PLACING_TRIES: Final = 1000
X_RANGE: Final = (0.34, 0.58)  # [m], of a drawn mid disk
Y_RANGE: Final = (-0.22, 0.22)  # [m]
TOUCHING: Final = 0.5  # share of drawn targets that start at the mid disk
TOUCHING_GAP: Final = 0.002  # [m], largest gap of those
TARGET_GAP: Final = 0.06  # [m], largest gap of the others
HALVINGS: Final = 20  # until a gap is exact to a micrometre
SPREAD: Final = 0.25  # [m], from the mid disk to further disks, at most, in x and in y


def draw_episode(
    seed: int,
    truth: TruthConfig,
    scene: Scene | None = None,
    shapes: tuple[str, ...] = (),
    friction: float = 0.0,
    roles: tuple[str, ...] = (),
) -> tuple[WorldParameters, Scene]:
    """Return what an episode is made of; what is not given is drawn from the seed.

    Args:
        seed: same seed, same episode.
        truth: the world that draws.
        scene: (N, 8), its velocities are ignored; the paper's start with two disks if None.
        shapes: of each body, as `sain_core.shapes` names them; none: all disks.
        friction: with the table; 0: as the world has it.
        roles: of each body, as `sain_core.shapes.bodies` names them; none: the paper's.

    Raises:
        InvalidInputError: a shape that does not exist, or too few or many bodies, shapes or roles.
        OutOfRangeError: a friction that is negative.
        ConfigError: a role that does not exist, or no pushable body.
    """
    if not friction >= 0.0:
        raise OutOfRangeError(f"friction is {friction}; it must be positive, or 0 to have it drawn")
    count = 2 if scene is None else len(scene)
    if count > MOST_BODIES:
        raise InvalidInputError(f"the scene has {count} bodies; at most {MOST_BODIES} are allowed")
    for name, given in (("shapes", shapes), ("roles", roles)):
        if len(given) not in (0, count):
            raise InvalidInputError(f"{len(given)} {name} are given for {count} disks")
    built = check_shapes(shapes or (DISK,) * count)
    parameters = truth.draw(generator(seed, "episode"), count, shapes=built)
    friction = friction or parameters.friction
    parameters = replace(parameters, roles=roles, friction=friction)
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


def draw_start(
    generator: np.random.Generator,
    parameters: WorldParameters,
    table: Table,
    spread: float = SPREAD,
) -> Scene:
    """Draw a start (N, 8): target at any bearing about the mid disk, others where there is room.

    A target with corners turns a side to the mid disk, and gets room for its corners.

    Raises:
        ConfigError: when the disks find no room.
    """
    radii = np.array(parameters.radii)
    shapes = parameters.body_shapes
    corners = np.array([shape.circumradius - 1.0 for shape in shapes]) * radii
    for _ in range(PLACING_TRIES):
        mid = np.array([generator.uniform(*X_RANGE), generator.uniform(*Y_RANGE)])
        touching = generator.uniform() < TOUCHING
        gap = generator.uniform(0.0, TOUCHING_GAP if touching else TARGET_GAP)
        bearing = generator.uniform(-pi, pi)
        target = mid + (radii[MID] + radii[TARGET] + gap) * unit(np.asarray(bearing))
        others = mid + generator.uniform(-spread, spread, (parameters.count - 2, 2))
        headings = generator.uniform(-pi, pi, parameters.count)
        headings[TARGET] = headings[TARGET] if shapes[TARGET].is_round else bearing
        scene = parameters.scene(np.vstack([mid, target, others]), headings)
        if _least_gap(scene, corners) >= 0.0 and wholly_on(scene, table):
            return scene
    raise ConfigError(
        f"no room for {parameters.count} disks in {PLACING_TRIES} tries; enlarge spread"
    )


def draw_bodies_start(
    generator: np.random.Generator, parameters: WorldParameters, table: Table
) -> Scene:
    """Draw a start (N, 8) of bodies of any shape, each of them near another one: half touch it.

    Raises:
        ConfigError: when the bodies find no room.
    """
    reach = np.array(parameters.radii) * [s.circumradius for s in parameters.body_shapes]
    for _ in range(PLACING_TRIES):
        scene = parameters.scene(
            np.zeros((parameters.count, 2)), generator.uniform(-pi, pi, parameters.count)
        )
        scene[0, POSITION] = generator.uniform(*X_RANGE), generator.uniform(*Y_RANGE)
        rings = [_ring(parameters, scene, body) for body in range(parameters.count)]
        for body in range(1, parameters.count):
            near = int(generator.integers(body))
            touching = generator.uniform() < TOUCHING
            gap = generator.uniform(0.0, TOUCHING_GAP if touching else TARGET_GAP)
            way = unit(np.asarray(generator.uniform(-pi, pi)))
            low, high = 0.0, float(reach[near] + reach[body]) + gap
            for _ in range(HALVINGS):
                middle = (low + high) / 2
                scene[body, POSITION] = scene[near, POSITION] + middle * way
                rings[body] = _ring(parameters, scene, body)
                close = rings[body].distance(rings[near]) < gap
                low, high = (middle, high) if close else (low, middle)
            scene[body, POSITION] = scene[near, POSITION] + high * way
            rings[body] = _ring(parameters, scene, body)
        apart = all(not one.intersects(other) for one, other in combinations(rings, 2))
        if apart and wholly_on(scene, table):
            return scene
    raise ConfigError(f"no room for {parameters.count} bodies in {PLACING_TRIES} tries; take fewer")


def _ring(parameters: WorldParameters, scene: Scene, body: int) -> Polygon:
    return Polygon(parameters.body_shapes[body].placed(scene[body]))


def _least_gap(scene: Scene, corners: Scalars) -> float:
    """Return the smallest gap of a scene (N, 8) whose corners reach out by so much (N,) [m]."""
    reach = corners[:, None] + corners
    reach[[MID, TARGET], [TARGET, MID]] = 0.0  # these face each other
    return float((surface_gaps(scene) - reach).min())


def wholly_on(scene: Scene, table: Table) -> bool:
    """Return whether no disk of a scene (N, 8) sticks out over the edge, where it could tip."""
    radii = scene[:, RADIUS, None]
    return bool(
        np.all(table.contains(scene[:, POSITION] - radii))
        and np.all(table.contains(scene[:, POSITION] + radii))
    )
