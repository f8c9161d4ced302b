"""The collision geometry of bodies, made of Bullet's primitives.

A body on feet touches others with a narrow rim at half its height: the height of a contact decides
how the feet share the load, and must not be left to rounding. A core of full height, a little
narrower, stops it from tipping far where the table ends.
"""

from functools import lru_cache
from math import cos, sin
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from shapely import Polygon as Ring

from sain_core.scene import DISK_HEIGHT
from sain_core.scratch import scratch_folder
from sain_core.shapes.shape import Pair, Shape, Solid, prism_surface
from sain_core.types import Points
from sain_sim.arm.client import Client
from sain_sim.world.parameters import FOOT_RADIUS

RIM_HEIGHT: Final = 0.002  # [m], of the part that touches tool and other disks
CORE_SHARE: Final = 0.9  # of the radius: of the full-height part within the rim
UNSEEN: Final = [0.001, 0.001, 0.001]  # [m], half the sides of a shape that is never drawn
CENTRED: Final[Pair] = (0.0, 0.0)  # offset of a centre of mass that is in the middle
HULL_MARGIN: Final = 0.001  # [m], which PyBullet adds all around a convex hull
THINNEST_HULL: Final = 0.0001  # [m]
MOST_PIECES: Final = 16  # of a body; Bullet leaves out further ones without an error


class Build(NamedTuple):
    """How a body is made."""

    shape: Shape
    mass: float  # [kg]
    radius: float  # [m]
    feet: tuple[Pair, ...]  # distance [radii] and bearing [rad] of each; none: it lies flat
    mass_offset: Pair = CENTRED  # [m], centre of mass in the body's frame


class Slab(NamedTuple):
    """A part of a body that has the body's outline."""

    radius: float  # [m]
    height: float  # [m]
    middle: list[float]  # [m], about the centre of mass


def unseen_shape(client: Client) -> int:
    """Create the visual shape of a body that is never drawn; pictures have a scene of their own.

    Without one, Bullet makes one of every collision shape, which takes longer than all the rest.
    """
    shape: int = client.createVisualShape(client.GEOM_BOX, halfExtents=UNSEEN)
    return shape


def collision_shape(client: Client, build: Build) -> int:
    """Create the collision shape of a body with its origin in the body's centre of mass."""
    slabs, feet = _slabs(build), _feet(build)
    if build.shape.solid is Solid.PRISM:
        return _hulls(client, build, slabs, feet)
    kind = client.GEOM_BOX if build.shape.solid is Solid.BOX else client.GEOM_CYLINDER
    collision: int = client.createCollisionShapeArray(
        shapeTypes=[kind] * len(slabs) + [client.GEOM_SPHERE] * len(feet),
        radii=[slab.radius for slab in slabs] + [FOOT_RADIUS] * len(feet),
        lengths=[slab.height for slab in slabs] + [0.0] * len(feet),
        halfExtents=[[slab.radius, slab.radius, slab.height / 2] for slab in slabs]
        + [[0.0, 0.0, 0.0]] * len(feet),
        collisionFramePositions=[slab.middle for slab in slabs] + feet,
    )
    return collision


def _hulls(client: Client, build: Build, slabs: list[Slab], feet: list[list[float]]) -> int:
    """Create the collision shape of a prism: a convex hull for each part of each slab.

    Where these are too many, the core lacks its smallest parts.
    """
    hulls = [
        (hull, slab)
        for slab in slabs
        for hull in _part_files(build.shape, build.radius, slab.radius, slab.height)
    ][: MOST_PIECES - len(feet)]
    collision: int = client.createCollisionShapeArray(
        shapeTypes=[client.GEOM_MESH] * len(hulls) + [client.GEOM_SPHERE] * len(feet),
        radii=[0.0] * len(hulls) + [FOOT_RADIUS] * len(feet),
        fileNames=[str(hull.path) for hull, _ in hulls] + [""] * len(feet),
        meshScales=[[1.0, 1.0, 1.0]] * (len(hulls) + len(feet)),
        collisionFramePositions=[slab.middle for _, slab in hulls] + feet,
    )
    return collision


def _slabs(build: Build) -> list[Slab]:
    """Return the rim and the core of a body on feet, or the one slab of a flat body."""
    lift = FOOT_RADIUS if build.feet else 0.0  # the feet's lower halves are below the body
    radius, (x, y) = build.radius, build.mass_offset
    core = Slab(radius, DISK_HEIGHT - lift, [0.0 - x, 0.0 - y, lift / 2])
    if not build.feet:
        return [core]
    rim = Slab(radius, RIM_HEIGHT, [0.0 - x, 0.0 - y, 0.0])
    return [rim, core._replace(radius=CORE_SHARE * radius)]


def _feet(build: Build) -> list[list[float]]:
    """Return the feet's centres about the body's centre of mass [m]."""
    drop = FOOT_RADIUS - DISK_HEIGHT / 2
    x, y = build.mass_offset
    places = ((share * build.radius, turn) for share, turn in build.feet)
    return [[away * cos(turn) - x, away * sin(turn) - y, drop] for away, turn in places]


class _MeshFile:
    """A prism on disk, as long as this object exists."""

    def __init__(self, corners: Points, height: float) -> None:
        self._folder = scratch_folder("shape")
        self.path = Path(self._folder.name) / "prism.obj"
        scale = [1.0, 1.0, height / DISK_HEIGHT]
        points = (prism_surface(corners).reshape(-1, 3) * scale).tolist()
        faces = np.arange(1, len(points) + 1).reshape(-1, 3).tolist()
        lines = [f"v {x} {y} {z}" for x, y, z in points] + [f"f {a} {b} {c}" for a, b, c in faces]
        self.path.write_text("\n".join(lines) + "\n")


@lru_cache(maxsize=64)
def _part_files(
    shape: Shape, radius: float, slab_radius: float, height: float
) -> tuple[_MeshFile, ...]:
    """Return the hulls of a prism's slab, each smaller by the margin that Bullet adds.

    A slab that is narrower than the body keeps its distance from the outline of every part. Parts
    that are thinner than that have none.
    """
    inset = HULL_MARGIN + (radius - slab_radius)
    rings = [Ring(part).buffer(-inset, join_style="mitre") for part in shape.parts(radius)]
    rings = sorted((ring for ring in rings if not ring.is_empty), key=lambda ring: -ring.area)
    corners = [np.array(ring.exterior.coords)[:-1] for ring in rings]
    thickness = max(height - 2 * HULL_MARGIN, THINNEST_HULL)
    return tuple(_MeshFile(points, thickness) for points in corners)
