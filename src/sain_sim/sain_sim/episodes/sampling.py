"""Where an episode starts and which pushes it tries."""

from dataclasses import dataclass
from math import pi
from typing import Final, Protocol

import numpy as np

from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.push import PaperGrid, PushLimits
from sain_core.scene import MID, POSITION, RADIUS, TARGET, Table, surface_gaps, unit, wrap_angle
from sain_core.types import Mask, PushArray, Scene
from sain_sim.world.parameters import WorldParameters

PLACING_TRIES: Final = 1000


@dataclass(frozen=True)
class StartConfig(Config):
    """Where the disks stand when an episode starts."""

    x_range: tuple[float, float] = option((0.34, 0.58), "of the mid disk", unit="m")
    y_range: tuple[float, float] = option((-0.22, 0.22), "of the mid disk", unit="m")
    touching: float = option(
        0.5, "share of episodes whose target starts at the mid disk", minimum=0.0, maximum=1.0
    )
    touching_gap: float = option(0.002, "largest gap of those", unit="m", minimum=0.0)
    target_gap: float = option(0.06, "largest gap of the others", unit="m", minimum=0.0)
    spread: float = option(
        0.25, "further disks, from the mid disk, at most", unit="m", minimum=0.1, maximum=0.6
    )


def draw_start(
    generator: np.random.Generator, parameters: WorldParameters, config: StartConfig, table: Table
) -> Scene:
    """Draw a start (N, 8): target at any bearing about the mid disk, others where there is room.

    A target that is a cube turns a side to the mid disk, and gets room for its corners.

    Raises:
        ConfigError: when the disks find no room.
    """
    radii = np.array(parameters.radii)
    cubes = np.array(parameters.cubes)
    for _ in range(PLACING_TRIES):
        mid = np.array([generator.uniform(*config.x_range), generator.uniform(*config.y_range)])
        touching = generator.uniform() < config.touching
        gap = generator.uniform(0.0, config.touching_gap if touching else config.target_gap)
        bearing = generator.uniform(-pi, pi)
        target = mid + (radii[MID] + radii[TARGET] + gap) * unit(np.asarray(bearing))
        others = mid + generator.uniform(-config.spread, config.spread, (parameters.count - 2, 2))
        headings = generator.uniform(-pi, pi, parameters.count)
        headings[TARGET] = bearing if cubes[TARGET] else headings[TARGET]
        scene = parameters.scene(np.vstack([mid, target, others]), headings)
        if _least_gap(scene, cubes) >= 0.0 and wholly_on(scene, table):
            return scene
    raise ConfigError(
        f"no room for {parameters.count} disks in {PLACING_TRIES} tries; enlarge spread"
    )


def _least_gap(scene: Scene, cubes: Mask) -> float:
    """Return the smallest gap of a scene (N, 8) with these cubes (N,), whose corners reach out."""
    gaps = surface_gaps(scene)
    reach = np.where(cubes, (2**0.5 - 1.0) * scene[:, RADIUS], 0.0)
    corners = reach[:, None] + reach
    corners[[MID, TARGET], [TARGET, MID]] = 0.0  # these face each other
    return float((gaps - corners).min())


def wholly_on(scene: Scene, table: Table) -> bool:
    """Tell whether no disk of a scene (N, 8) sticks out over the edge, where it could tip."""
    radii = scene[:, RADIUS, None]
    return bool(
        np.all(table.contains(scene[:, POSITION] - radii))
        and np.all(table.contains(scene[:, POSITION] + radii))
    )


class PushSampler(Protocol):
    """Draws a push to try in a scene; whether it can be carried out shows later."""

    def draw(self, generator: np.random.Generator, scene: Scene) -> PushArray:
        """Return a push (3,) for a scene (N, 8)."""
        ...


@dataclass(frozen=True)
class CircleSampler(Config):
    """Pushes from any side of the disk; a share of them roughly through the target."""

    limits: PushLimits = PushLimits()
    aimed: float = option(0.6, "share of pushes aimed through the target", minimum=0.0, maximum=1.0)
    aim_spread: float = option(
        0.35, "standard deviation of the aim", unit="rad", minimum=0.0, maximum=pi
    )
    shortest: float = option(0.02, "shortest travel", unit="m", minimum=0.0, maximum=0.15)

    def draw(self, generator: np.random.Generator, scene: Scene) -> PushArray:
        """Return a push (3,) for a scene (N, 8)."""
        limits = self.limits
        angle = generator.uniform(-limits.max_angle, limits.max_angle)
        length = generator.uniform(self.shortest, limits.max_length)
        heading = generator.uniform(-pi, pi)
        if generator.uniform() < self.aimed:
            way = scene[TARGET, POSITION] - scene[MID, POSITION]
            heading = np.arctan2(way[1], way[0]) + generator.normal(0.0, self.aim_spread)
        return np.array([wrap_angle(np.asarray(heading - angle)), angle, length])


class GridSampler:
    """The paper's: one of 105 pushes, each as likely (section III-B a)."""

    def __init__(self, grid: PaperGrid) -> None:
        """Draw from this grid."""
        self._pushes = grid.pushes()

    def draw(self, generator: np.random.Generator, scene: Scene) -> PushArray:
        """Return a push (3,), whatever the scene."""
        return np.asarray(self._pushes[generator.integers(len(self._pushes))])
