"""Disks made of primitives, with the mass and inertia of a uniform body.

A disk on feet touches others with a narrow rim at half its height: the height of a contact decides
how the feet share the load, and must not be left to rounding. A core of full height, a little
narrower, stops it from tipping far where the table ends.
"""

from math import cos, hypot, pi, sin
from typing import Final, NamedTuple

from jaxtyping import Float
from numpy import ndarray

from sain_core.scene import DISK_HEIGHT, SETTLED_SPEED, SETTLED_SPIN, THETA, X, Y
from sain_sim.arm.client import Client
from sain_sim.world.parameters import CUBE, FLAT
from sain_sim.world.roughness import Feet, Pair

FOOT_RADIUS: Final = 0.004  # [m]
RIM_HEIGHT: Final = 0.002  # [m], of the part that touches tool and other disks
CORE_SHARE: Final = 0.9  # of the radius: of the full-height part within the rim
FOOT_PLACE: Final = 0.7  # distance of a foot from the centre, in radii
REGULAR_FEET: Final[Feet] = (
    (FOOT_PLACE, 0.0),
    (FOOT_PLACE, 2 * pi / 3),
    (FOOT_PLACE, 4 * pi / 3),
)

UNSEEN: Final = [0.001, 0.001, 0.001]  # [m], half the sides of a shape that is never drawn

FALLEN_HEIGHT: Final = -0.01  # [m], a disk whose middle is lower has left the table
CENTRED: Final[Pair] = (0.0, 0.0)  # offset of a centre of mass that is in the middle

Vector = tuple[float, float, float]
Planar = tuple[float, float, float, float, float, float]  # x y theta vx vy omega


class Build(NamedTuple):
    """How a disk is made."""

    shape: str  # one of `sain_sim.world.parameters.SHAPES`
    mass: float  # [kg]
    radius: float  # [m], half the width of a cube
    mass_offset: Pair = CENTRED  # [m], centre of mass in the disk's frame
    feet: Feet = REGULAR_FEET


class BodyState(NamedTuple):
    """All of a rigid body's state, as Bullet gives and takes it: that of its centre of mass."""

    position: Vector  # [m]
    orientation: tuple[float, float, float, float]  # quaternion x y z w
    velocity: Vector = (0.0, 0.0, 0.0)  # [m/s]
    spin: Vector = (0.0, 0.0, 0.0)  # [rad/s]


class Disk:
    """One disk of a world."""

    def __init__(
        self,
        client: Client,
        build: Build,
        state: BodyState,
        friction: float,
    ) -> None:
        """Make a disk.

        Args:
            client: the world's client.
            build: what it is.
            state: where it is and how it moves.
            friction: of this body alone; Bullet multiplies those of two.
        """
        self._client = client
        self.build = build
        self.body = client.createMultiBody(
            build.mass,
            collision_shape(client, build),
            unseen_shape(client),
            state.position,
            state.orientation,
        )
        client.changeDynamics(
            self.body,
            -1,
            localInertiaDiagonal=inertia(build.shape, build.mass, build.radius),
            lateralFriction=friction,
            restitution=0.0,
            rollingFriction=0.0,
            spinningFriction=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            activationState=client.ACTIVATION_STATE_DISABLE_SLEEPING,
        )
        client.resetBaseVelocity(self.body, state.velocity, state.spin)

    def place(self) -> Vector:
        """Return where the centre of mass is [m]."""
        position: Vector = self._client.getBasePositionAndOrientation(self.body)[0]
        return position

    def state(self) -> BodyState:
        """Return where the body is and how it moves."""
        pose = self._client.getBasePositionAndOrientation(self.body)
        return BodyState(*pose, *self._client.getBaseVelocity(self.body))

    def planar(self, state: BodyState) -> Planar:
        """Return place, heading and velocity of the disk's middle when its body is in a state."""
        x, y, _ = state.position
        vx, vy, _ = state.velocity
        omega = state.spin[2]
        heading = self._client.getEulerFromQuaternion(state.orientation)[2]
        if self.build.mass_offset != CENTRED:  # a body's place is its centre of mass
            along, across = turned(self.build.mass_offset, heading)
            x, y, vx, vy = x - along, y - across, vx + across * omega, vy - along * omega
        return x, y, heading, vx, vy, omega

    def fallen(self) -> bool:
        """Tell whether the disk has left the table."""
        return self.place()[2] < FALLEN_HEIGHT

    def still(self) -> bool:
        """Tell whether the disk is settled; of one that is in its middle, this asks only speeds."""
        if self.build.mass_offset == CENTRED:
            (vx, vy, _), (_, _, omega) = self._client.getBaseVelocity(self.body)
        else:
            *_, vx, vy, omega = self.planar(self.state())
        return hypot(vx, vy) < SETTLED_SPEED and abs(omega) < SETTLED_SPIN


def resting(client: Client, state: Float[ndarray, "8"], mass_offset: Pair = CENTRED) -> BodyState:
    """Return the body state of a disk's state (8,) that stands on the table at rest.

    Args:
        client: the world's client.
        state: of the disk; its velocities are ignored.
        mass_offset: centre of mass in the disk's frame [m].
    """
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


def inertia(shape: str, mass: float, radius: float) -> Vector:
    """Return the principal moments [kg m^2] of a uniform cylinder, or of a square block."""
    if shape == CUBE:
        across = mass * ((2 * radius) ** 2 + DISK_HEIGHT**2) / 12
        return across, across, mass * (2 * radius) ** 2 / 6
    across = mass * (3 * radius**2 + DISK_HEIGHT**2) / 12
    return across, across, mass * radius**2 / 2


def unseen_shape(client: Client) -> int:
    """Create the visual shape of a body that no one looks at; pictures have a scene of their own.

    Told of none, Bullet makes one of every collision shape, which takes longer than all the rest.
    """
    shape: int = client.createVisualShape(client.GEOM_BOX, halfExtents=UNSEEN)
    return shape


def collision_shape(client: Client, build: Build) -> int:
    """Create the collision shape of a disk with its origin in the disk's centre of mass."""
    shape, radius, (x, y) = build.shape, build.radius, build.mass_offset
    lift = 0.0 if shape == FLAT else FOOT_RADIUS  # the feet's lower halves are below the body
    kind = client.GEOM_BOX if shape == CUBE else client.GEOM_CYLINDER
    height = DISK_HEIGHT - lift
    middle = [0.0 - x, 0.0 - y, lift / 2]
    bodies = [(radius, height, middle)]
    feet: list[list[float]] = []
    if shape != FLAT:
        bodies = [
            (radius, RIM_HEIGHT, [0.0 - x, 0.0 - y, 0.0]),
            (CORE_SHARE * radius, height, middle),
        ]
        feet = _feet(build)
    collision: int = client.createCollisionShapeArray(
        shapeTypes=[kind] * len(bodies) + [client.GEOM_SPHERE] * len(feet),
        radii=[width for width, _, _ in bodies] + [FOOT_RADIUS] * len(feet),
        lengths=[tall for _, tall, _ in bodies] + [0.0] * len(feet),
        halfExtents=[[width, width, tall / 2] for width, tall, _ in bodies]
        + [[0.0, 0.0, 0.0]] * len(feet),
        collisionFramePositions=[place for _, _, place in bodies] + feet,
    )
    return collision


def _feet(build: Build) -> list[list[float]]:
    """Return the feet's centres about the disk's centre of mass [m]."""
    drop = FOOT_RADIUS - DISK_HEIGHT / 2
    x, y = build.mass_offset
    places = ((share * build.radius, turn) for share, turn in build.feet)
    return [[away * cos(turn) - x, away * sin(turn) - y, drop] for away, turn in places]
