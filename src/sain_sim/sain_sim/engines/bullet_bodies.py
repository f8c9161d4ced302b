"""The bodies of a world in Bullet: what they are made of, and how they move.

A body touches others with a narrow rim at half its height: the height of a contact decides how
the supports share the load, and must not be left to rounding. A core of full height, a little
narrower, stops it from tipping far where the table ends. It stands on small balls.
"""

from functools import lru_cache
from math import cos, sin
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from shapely import Polygon as Ring

from sain_core.errors import ConfigError
from sain_core.scene import DISK_HEIGHT, THETA, X, Y
from sain_core.scratch import scratch_folder
from sain_core.shapes.shape import Pair, Shape, Solid, Vector, prism_surface
from sain_core.types import Points
from sain_sim.engines.bullet_client import Client
from sain_sim.world.parameters import FOOT_RADIUS, WorldParameters
from sain_sim.world.workcell import support_drop

RIM_HEIGHT: Final = 0.002  # [m], of the part that touches tool and other bodies
CORE_SHARE: Final = 0.9  # of the radius: of the full-height part within the rim
UNSEEN: Final = [0.001, 0.001, 0.001]  # [m], half the sides of a shape that is never drawn
CENTRED: Final[Pair] = (0.0, 0.0)  # offset of a centre of mass that is in the middle
HULL_MARGIN: Final = 0.001  # [m], which PyBullet adds all around a convex hull
THINNEST_HULL: Final = 0.0001  # [m]
MOST_PIECES: Final = 16  # of a body; Bullet leaves out further ones without an error

Planar = tuple[float, float, float, float, float, float]  # x y theta vx vy omega


class BodyState(NamedTuple):
    """All of a rigid body's state, as Bullet gives and takes it: that of its centre of mass."""

    position: Vector  # [m]
    orientation: tuple[float, float, float, float]  # quaternion x y z w
    velocity: Vector = (0.0, 0.0, 0.0)  # [m/s]
    spin: Vector = (0.0, 0.0, 0.0)  # [rad/s]


def check_simulated(parameters: WorldParameters) -> None:
    """Raise `ConfigError` for a body of another height, or with too many parts."""
    for body, shape in enumerate(parameters.body_shapes):
        parts, most = len(shape.parts(1.0)), MOST_PIECES - len(parameters.supports(body))
        if parts > most or parameters.tops[body] != DISK_HEIGHT:
            raise ConfigError(
                f"body {body} ({shape.name}) has {parts} convex parts and is"
                f" {1e3 * parameters.tops[body]:.0f} mm high; in engine bullet bodies have up to"
                f" {most} parts and {1e3 * DISK_HEIGHT:.0f} mm: use engine mujoco"
            )


class Slab(NamedTuple):
    """A part of a body that has the body's outline."""

    radius: float  # [m]
    height: float  # [m]
    middle: list[float]  # [m], about the centre of mass


class Body:
    """One body of a world."""

    def __init__(
        self,
        client: Client,
        parameters: WorldParameters,
        index: int,
        state: BodyState,
        friction: float,
    ) -> None:
        """Make a body of the world's parameters in a state.

        Its friction [-] is of this body alone; Bullet multiplies those of two.
        """
        self._client = client
        self._offset = parameters.mass_offsets[index]
        shape, self.radius = parameters.body_shapes[index], parameters.radii[index]
        self.mass = parameters.masses[index]
        mass = 0.0 if index in parameters.bodies.fixed else self.mass
        self.id = client.createMultiBody(
            mass,
            _collision_shape(client, parameters, index),
            unseen_shape(client),
            state.position,
            state.orientation,
        )
        client.changeDynamics(
            self.id,
            -1,
            localInertiaDiagonal=shape.inertia(mass, self.radius),
            lateralFriction=friction,
            restitution=0.0,
            rollingFriction=0.0,
            spinningFriction=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            activationState=client.ACTIVATION_STATE_DISABLE_SLEEPING,
        )
        client.resetBaseVelocity(self.id, state.velocity, state.spin)

    def place(self) -> Vector:
        """Return where the centre of mass is [m]."""
        position: Vector = self._client.getBasePositionAndOrientation(self.id)[0]
        return position

    def state(self) -> BodyState:
        """Return where the body is and how it moves."""
        pose = self._client.getBasePositionAndOrientation(self.id)
        return BodyState(*pose, *self._client.getBaseVelocity(self.id))

    def planar(self, state: BodyState) -> Planar:
        """Return pose and velocity of the body's middle in a state of its centre of mass."""
        x, y, _ = state.position
        vx, vy, _ = state.velocity
        omega = state.spin[2]
        heading = self._client.getEulerFromQuaternion(state.orientation)[2]
        if self._offset != CENTRED:  # Bullet's place is the centre of mass
            along, across = turned(self._offset, heading)
            x, y, vx, vy = x - along, y - across, vx + across * omega, vy - along * omega
        return x, y, heading, vx, vy, omega


def resting(client: Client, state: Float[ndarray, "8"], mass_offset: Pair = CENTRED) -> BodyState:
    """Return the body state of a scene's row (8,), at rest, with this centre of mass [m]."""
    heading = float(state[THETA])
    orientation = client.getQuaternionFromEuler([0.0, 0.0, heading])
    x, y = turned(mass_offset, heading)
    return BodyState((float(state[X]) + x, float(state[Y]) + y, DISK_HEIGHT / 2), orientation)


def turned(pair: Pair, angle: float) -> Pair:
    """Return a vector turned by an angle [rad]; what has no length stays as it is."""
    if pair == CENTRED:
        return pair
    x, y = pair
    return cos(angle) * x - sin(angle) * y, sin(angle) * x + cos(angle) * y


def unseen_shape(client: Client) -> int:
    """Create the visual shape of a body that is never drawn; pictures have a scene of their own.

    Without one, Bullet makes one of every collision shape, which takes longer than all the rest.
    """
    shape: int = client.createVisualShape(client.GEOM_BOX, halfExtents=UNSEEN)
    return shape


def _collision_shape(client: Client, parameters: WorldParameters, index: int) -> int:
    """Create the collision shape of a body with its origin in the body's centre of mass.

    A prism has a convex hull for each part of each slab. Where these are too many, the core lacks
    its smallest parts.
    """
    shape, radius = parameters.body_shapes[index], parameters.radii[index]
    x, y = parameters.mass_offsets[index]
    rim = Slab(radius, RIM_HEIGHT, [0.0 - x, 0.0 - y, 0.0])
    lift = [0.0 - x, 0.0 - y, FOOT_RADIUS / 2]  # the lower halves of the balls are below the body
    slabs = [rim, Slab(CORE_SHARE * radius, DISK_HEIGHT - FOOT_RADIUS, lift)]
    drop = support_drop(parameters, index)
    feet = [[a - x, b - y, drop] for a, b in parameters.supports(index).tolist()]
    balls = [client.GEOM_SPHERE] * len(feet)
    if shape.solid is Solid.PRISM:
        hulls = [
            (hull, slab)
            for slab in slabs
            for hull in _part_files(shape, radius, slab.radius, slab.height)
        ][: MOST_PIECES - len(feet)]
        made: int = client.createCollisionShapeArray(
            shapeTypes=[client.GEOM_MESH] * len(hulls) + balls,
            radii=[0.0] * len(hulls) + [FOOT_RADIUS] * len(feet),
            fileNames=[str(hull.path) for hull, _ in hulls] + [""] * len(feet),
            meshScales=[[1.0, 1.0, 1.0]] * (len(hulls) + len(feet)),
            collisionFramePositions=[slab.middle for _, slab in hulls] + feet,
        )
        return made
    kind = client.GEOM_BOX if shape.solid is Solid.BOX else client.GEOM_CYLINDER
    plain: int = client.createCollisionShapeArray(
        shapeTypes=[kind] * len(slabs) + balls,
        radii=[slab.radius for slab in slabs] + [FOOT_RADIUS] * len(feet),
        lengths=[slab.height for slab in slabs] + [0.0] * len(feet),
        halfExtents=[[slab.radius, slab.radius, slab.height / 2] for slab in slabs]
        + [[0.0, 0.0, 0.0]] * len(feet),
        collisionFramePositions=[slab.middle for slab in slabs] + feet,
    )
    return plain


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
