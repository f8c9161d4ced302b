"""The bodies of a world: what they are made of, and how they move."""

from math import cos, hypot, sin
from typing import NamedTuple

from jaxtyping import Float
from numpy import ndarray

from sain_core.scene import DISK_HEIGHT, SETTLED_SPEED, SETTLED_SPIN, THETA, X, Y
from sain_core.shapes.shape import Pair, Vector
from sain_sim.arm.client import Client
from sain_sim.engines.bullet.collision import CENTRED, Build, collision_shape, unseen_shape
from sain_sim.world.workcell import FALLEN_HEIGHT

Planar = tuple[float, float, float, float, float, float]  # x y theta vx vy omega


class BodyState(NamedTuple):
    """All of a rigid body's state, as Bullet gives and takes it: that of its centre of mass."""

    position: Vector  # [m]
    orientation: tuple[float, float, float, float]  # quaternion x y z w
    velocity: Vector = (0.0, 0.0, 0.0)  # [m/s]
    spin: Vector = (0.0, 0.0, 0.0)  # [rad/s]


class Body:
    """One body of a world."""

    def __init__(self, client: Client, build: Build, state: BodyState, friction: float) -> None:
        """Make a body.

        Args:
            client: the world's client.
            build: what it is.
            state: where it is and how it moves.
            friction: of this body alone; Bullet multiplies those of two.
        """
        self._client = client
        self.build = build
        self.id = client.createMultiBody(
            build.mass,
            collision_shape(client, build),
            unseen_shape(client),
            state.position,
            state.orientation,
        )
        client.changeDynamics(
            self.id,
            -1,
            localInertiaDiagonal=build.shape.inertia(build.mass, build.radius),
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
        if self.build.mass_offset != CENTRED:  # Bullet's place is the centre of mass
            along, across = turned(self.build.mass_offset, heading)
            x, y, vx, vy = x - along, y - across, vx + across * omega, vy - along * omega
        return x, y, heading, vx, vy, omega

    def fallen(self) -> bool:
        """Tell whether the body has left the table."""
        return self.place()[2] < FALLEN_HEIGHT

    def still(self) -> bool:
        """Tell whether the body is settled; a mass in the middle needs only its speeds."""
        if self.build.mass_offset == CENTRED:
            (vx, vy, _), (_, _, omega) = self._client.getBaseVelocity(self.id)
        else:
            *_, vx, vy, omega = self.planar(self.state())
        return hypot(vx, vy) < SETTLED_SPEED and abs(omega) < SETTLED_SPIN


def resting(client: Client, state: Float[ndarray, "8"], mass_offset: Pair = CENTRED) -> BodyState:
    """Return the body state of a body's state (8,) that stands on the table at rest.

    Args:
        client: the world's client.
        state: of the body; its velocities are ignored.
        mass_offset: centre of mass in the body's frame [m].
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
