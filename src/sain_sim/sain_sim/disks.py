"""Disks made of primitives, with the mass and inertia of a uniform body.

A disk on feet touches others with a narrow rim at half its height: the height of a contact decides
how the feet share the load, and must not be left to rounding. A core of full height, a little
narrower, stops it from tipping far where the table ends.
"""

from math import cos, pi, sin
from typing import Final, NamedTuple

from jaxtyping import Float
from numpy import ndarray

from sain_core.scene import DISK_HEIGHT, THETA, X, Y
from sain_sim.client import Client
from sain_sim.parameters import CUBE, FLAT

FOOT_RADIUS: Final = 0.004  # [m]
RIM_HEIGHT: Final = 0.002  # [m], of the part that touches tool and other disks
CORE_SHARE: Final = 0.9  # of the radius: of the full-height part within the rim
FOOT_PLACE: Final = 0.7  # distance of a foot from the centre, in radii

# mid disk, target, and the others in turn
COLORS: Final = (
    (0.20, 0.45, 0.80, 1.0),
    (0.93, 0.42, 0.18, 1.0),
    (0.42, 0.62, 0.45, 1.0),
    (0.62, 0.50, 0.74, 1.0),
    (0.80, 0.70, 0.36, 1.0),
)

Vector = tuple[float, float, float]


class BodyState(NamedTuple):
    """All of a rigid body's state, as Bullet gives and takes it."""

    position: Vector  # [m]
    orientation: tuple[float, float, float, float]  # quaternion x y z w
    velocity: Vector = (0.0, 0.0, 0.0)  # [m/s]
    spin: Vector = (0.0, 0.0, 0.0)  # [rad/s]


class Disk:
    """One disk of a world."""

    def __init__(
        self,
        client: Client,
        kind: tuple[str, float, float],
        state: BodyState,
        friction: float,
        color: tuple[float, ...],
    ) -> None:
        """Make a disk.

        Args:
            client: the world's client.
            kind: shape (one of `sain_sim.parameters.SHAPES`), mass [kg], and radius [m], which
                is half the width of a cube.
            state: where it is and how it moves.
            friction: of this body alone; Bullet multiplies those of two.
            color: red, green, blue, opacity.
        """
        self._client = client
        shape, mass, radius = kind
        collision, visual = disk_shapes(client, shape, radius, color)
        self.body = client.createMultiBody(
            mass, collision, visual, state.position, state.orientation
        )
        client.changeDynamics(
            self.body,
            -1,
            localInertiaDiagonal=inertia(shape, mass, radius),
            lateralFriction=friction,
            restitution=0.0,
            rollingFriction=0.0,
            spinningFriction=0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            activationState=client.ACTIVATION_STATE_DISABLE_SLEEPING,
        )
        client.resetBaseVelocity(self.body, state.velocity, state.spin)

    def state(self) -> BodyState:
        """Return where the body is and how it moves."""
        pose = self._client.getBasePositionAndOrientation(self.body)
        return BodyState(*pose, *self._client.getBaseVelocity(self.body))


def resting(client: Client, state: Float[ndarray, "8"]) -> BodyState:
    """Return the body state of a disk's state (8,) that stands on the table at rest."""
    orientation = client.getQuaternionFromEuler([0.0, 0.0, float(state[THETA])])
    return BodyState((float(state[X]), float(state[Y]), DISK_HEIGHT / 2), orientation)


def inertia(shape: str, mass: float, radius: float) -> Vector:
    """Return the principal moments [kg m^2] of a uniform cylinder, or of a square block."""
    if shape == CUBE:
        across = mass * ((2 * radius) ** 2 + DISK_HEIGHT**2) / 12
        return across, across, mass * (2 * radius) ** 2 / 6
    across = mass * (3 * radius**2 + DISK_HEIGHT**2) / 12
    return across, across, mass * radius**2 / 2


def disk_shapes(
    client: Client, shape: str, radius: float, color: tuple[float, ...]
) -> tuple[int, int]:
    """Create collision and visual shape with their origin in the middle of the disk."""
    lift = 0.0 if shape == FLAT else FOOT_RADIUS  # the feet's lower halves are below the body
    kind = client.GEOM_BOX if shape == CUBE else client.GEOM_CYLINDER
    height = DISK_HEIGHT - lift
    size = [radius, radius, height / 2]
    middle = [0.0, 0.0, lift / 2]
    visual = client.createVisualShape(
        kind,
        radius=radius,
        length=height,
        halfExtents=size,
        rgbaColor=color,
        specularColor=[0.25, 0.25, 0.25],
        visualFramePosition=middle,
    )
    bodies = [(radius, height, middle)]
    feet: list[list[float]] = []
    if shape != FLAT:
        bodies = [(radius, RIM_HEIGHT, [0.0, 0.0, 0.0]), (CORE_SHARE * radius, height, middle)]
        feet = _feet(radius)
    collision = client.createCollisionShapeArray(
        shapeTypes=[kind] * len(bodies) + [client.GEOM_SPHERE] * len(feet),
        radii=[width for width, _, _ in bodies] + [FOOT_RADIUS] * len(feet),
        lengths=[tall for _, tall, _ in bodies] + [0.0] * len(feet),
        halfExtents=[[width, width, tall / 2] for width, tall, _ in bodies]
        + [[0.0, 0.0, 0.0]] * len(feet),
        collisionFramePositions=[place for _, _, place in bodies] + feet,
    )
    return collision, visual


def _feet(radius: float) -> list[list[float]]:
    """Return the feet's centres in the disk's frame [m]."""
    place = FOOT_PLACE * radius
    drop = FOOT_RADIUS - DISK_HEIGHT / 2
    return [[place * cos(turn), place * sin(turn), drop] for turn in (0, 2 * pi / 3, 4 * pi / 3)]
