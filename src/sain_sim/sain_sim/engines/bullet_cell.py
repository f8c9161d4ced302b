"""A workcell in PyBullet: the arm in it, and its control steps."""

from math import hypot, sqrt
from typing import Final

import numpy as np

from sain_core.scene import Table
from sain_core.types import Scalars, Scene
from sain_sim.arm.client import Client
from sain_sim.arm.motion import (
    FLANGE_DROP,
    JOINT_COUNT,
    STOCK_TORQUE,
    TIME_STEP,
    TOOL_LENGTH,
    WRIST_OFFSET,
    ControlledArm,
    Joints,
    Kinematics,
    Tips,
)
from sain_sim.arm.panda import SPRUNG_MASS, TORQUE_SCALE, PandaModel
from sain_sim.engines.bullet_bodies import Body, BodyState, resting, unseen_shape
from sain_sim.world.parameters import FLOOR_SIZE, THINNEST_TABLE, WorldParameters, table_box
from sain_sim.world.workcell import (
    GRAVITY,
    SAG,
    CellState,
    Simulation,
    Workcell,
    WorldConfig,
    lean_of,
)

STICK_LINK: Final = 6  # the stick is part of the last link
JOINTS: Final = range(JOINT_COUNT)
UNIT_GAINS: Final = [1.0] * JOINT_COUNT
GAINS: Final = [0.6] * JOINT_COUNT  # share of a position error that a step corrects
TORQUES: Final = (TORQUE_SCALE * STOCK_TORQUE).tolist()
WEAKEST: Final = float(STOCK_TORQUE.min())
SLIDES: Final = (7, 8)  # joints of a spring, and the links behind them; the stick is the second
ALL_JOINTS: Final = range(9)  # the arm's and the slides
REST: Final = [0.0] * len(ALL_JOINTS)
DAMPING: Final = 1.0  # as a share of critical damping


class ToolSpring:
    """Pulls a compliant stick back to where the hand holds it; forces hold for one step each.

    A spring and a damper act in two directions across the stick, as an arm under impedance control
    does. Bullet's motors cannot be soft at any gain, but a mass on a spring can, and Bullet solves
    its contacts.
    """

    def __init__(
        self, client: Client, body: int, stiffness: float, limited: bool, radius: float
    ) -> None:
        """Hold the stick of a loaded arm, of this radius [m], by a spring [N/m].

        If it is limited, it asks no more of the arm's joints than Franka's torques.
        """
        self._client, self._limited = client, limited
        self._contact = [0.0, 0.0, (TOOL_LENGTH - 2 * radius) / 2]  # from the stick's link
        self._hang = hypot(WRIST_OFFSET, FLANGE_DROP + TOOL_LENGTH)  # from wrist to tip [m]
        self._body = body
        self._stiffness = stiffness
        self._damping = DAMPING * 2.0 * sqrt(stiffness * SPRUNG_MASS)
        self.link = SLIDES[-1]
        zeros = [0.0, 0.0]
        client.setJointMotorControlArray(  # PyBullet's joints start out with a brake
            body, SLIDES, client.VELOCITY_CONTROL, targetVelocities=zeros, forces=zeros
        )

    def relax(self) -> None:
        """Set the stick to where the hand holds it, at rest."""
        for joint in SLIDES:
            self._client.resetJointState(self._body, joint, 0.0, 0.0)

    def pull(self) -> None:
        """Apply the spring's force for the next step."""
        (x, vx, *_), (y, vy, *_) = self._client.getJointStates(self._body, SLIDES)
        forces = [
            -self._stiffness * x - self._damping * vx,
            -self._stiffness * y - self._damping * vy,
        ]
        if self._limited and not self._light(hypot(*forces), abs(x) + abs(y)):
            share = self._share(np.array(forces))
            forces = [share * force for force in forces]
        self._client.setJointMotorControlArray(
            self._body, SLIDES, self._client.TORQUE_CONTROL, forces=forces
        )

    def _light(self, force: float, shift: float) -> bool:
        """Return whether the joints bear a force [N] on a stick shifted by so much [m] in any pose.

        The weakest joints are the wrist's. Those before it are less than four times as far away,
        and seven times as strong.
        """
        return force * (self._hang + shift) <= WEAKEST

    def _share(self, forces: np.ndarray) -> float:
        """Return which share of the spring's forces (2,) [N] the joints can bear.

        What the arm's own weight takes of their torque is left out.
        """
        angles = [state[0] for state in self._client.getJointStates(self._body, ALL_JOINTS)]
        linear, _ = self._client.calculateJacobian(
            self._body, self.link, self._contact, angles, REST, REST
        )
        jacobian = np.array(linear)  # (3, 9)
        asked = np.abs(jacobian[:, :7].T @ jacobian[:, 7:] @ forces)  # (7,) [N m]
        over = float((asked / STOCK_TORQUE).max())
        return 1.0 / over if over > 1.0 else 1.0

    def tip(self, held: Tips) -> Tips:
        """Return where the tip is (3,) [m] when the hand holds it at a point (3,)."""
        state = self._client.getLinkState(self._body, self.link, computeForwardKinematics=True)
        return np.array([*state[4][:2], held[2]])


class Arm(ControlledArm):
    """A Panda of Bullet's, moved by its motors."""

    def __init__(
        self, client: Client, body: int, kinematics: Kinematics, spring: ToolSpring | None
    ) -> None:
        """Control a loaded arm, with a stick that is rigid or on a spring."""
        super().__init__(kinematics)
        self._client, self.body, self.spring = client, body, spring
        self.stick = STICK_LINK if spring is None else spring.link

    def set_friction(self, value: float) -> None:
        """Set the stick's friction coefficient as Bullet multiplies it."""
        self._client.changeDynamics(
            self.body, self.stick, lateralFriction=value, restitution=0.0, rollingFriction=0.0
        )

    def put(self, joints: Joints) -> None:
        """Set the joints to angles (7,) at once, at rest."""
        for joint, value in enumerate(joints.tolist()):
            self._client.resetJointState(self.body, joint, value, 0.0)
        if self.spring is not None:
            self.spring.relax()

    def command(self, joints: list[float], speeds: list[float]) -> None:
        """Command angles of now (7) [rad], and speeds (7) [rad/s] that lead to the next ones."""
        self._client.setJointMotorControlArray(
            self.body,
            JOINTS,
            self._client.POSITION_CONTROL,
            targetPositions=joints,
            targetVelocities=speeds,
            forces=TORQUES,
            positionGains=GAINS,
            velocityGains=UNIT_GAINS,
        )

    def joint_states(self) -> tuple[Joints, Joints]:
        """Return the joint angles (7,) [rad] and speeds (7,) [rad/s]."""
        states = self._client.getJointStates(self.body, range(JOINT_COUNT))
        return np.array([s[0] for s in states]), np.array([s[1] for s in states])

    def tool(self) -> Tips:
        """Return where the tool's tip is, (3,) [m]; a stick on a spring is not where it is held."""
        return self.tip() if self.spring is None else self.spring.tip(self.tip())


CONTACT_BREAKING: Final = 0.001  # [m]; Bullet's 0.02 keeps contacts of rims that slid apart
TABLE_BITS: Final = 0xFF00  # of the collision groups of tables that are one body's alone
FLOOR_THICKNESS: Final = 0.05  # [m]


class BulletSimulation(Simulation):
    """A physics server, and the descriptions of the arms that it loads."""

    def __init__(self, config: WorldConfig) -> None:
        """Connect to a server of its own."""
        super().__init__(config)
        self.client = Client()
        self._models: dict[bool, PandaModel] = {}  # with a rigid stick, and with one on a spring

    def resting(self, scene: Scene, parameters: WorldParameters) -> list[BodyState]:
        """Return the states of bodies that stand at rest where a scene (N, 8) has them."""
        rows = zip(scene, parameters.mass_offsets, strict=True)
        return [resting(self.client, state, offset) for state, offset in rows]

    def build(self, parameters: WorldParameters, origin: CellState, steps: int) -> "BulletCell":
        """Build a workcell with these bodies, after so many earlier control steps."""
        sprung = parameters.roughness.spring > 0.0
        if sprung not in self._models:  # each description is written once
            radius = self.config.feasibility.limits.tool_radius
            self._models[sprung] = PandaModel(radius, sprung=sprung)
        model = self._models[sprung]
        return BulletCell(self.client, model, self.config, parameters, origin, steps)

    def close(self) -> None:
        """Disconnect; a second call does nothing."""
        self.client.close()


class BulletCell(Workcell):
    """Built for one push; building takes about 2 ms.

    Bullet's contact solver and broad phase keep data from earlier steps. These can be neither read
    nor saved (`saveState` loses them, and last bits), so equal worlds would give different
    results. A new workcell has none.

    Bullet multiplies the friction coefficients of two bodies. Those of the single bodies are
    chosen so that the products are the parameters' values for table, rims and tool.
    """

    arm: Arm

    def __init__(
        self,
        client: Client,
        model: PandaModel,
        config: WorldConfig,
        parameters: WorldParameters,
        origin: CellState,
        steps: int,
    ) -> None:
        """Empty the client and build everything in it, the bodies in the origin's states."""
        super().__init__(config, parameters, origin, steps)
        self._client = client
        table = config.feasibility.table
        client.resetSimulation()
        client.setGravity(*parameters.roughness.gravity(GRAVITY))
        client.setTimeStep(TIME_STEP)
        client.setPhysicsEngineParameter(
            deterministicOverlappingPairs=1, contactBreakingThreshold=CONTACT_BREAKING
        )
        body = model.load(client, -table.height)
        spring, rough = None, parameters.roughness
        if rough.spring > 0.0:
            radius = config.feasibility.limits.tool_radius
            spring = ToolSpring(client, body, rough.spring, rough.stock_joints, radius)
        self.arm = Arm(client, body, config.kinematics, spring)
        self.arm.place(origin.joints)
        friction = parameters.rim_friction**0.5  # of a body alone
        self._table_friction = parameters.friction / friction  # of a table alone
        self.tables = self._build_tables(table)
        self._build_floor(table)
        self.bodies = [
            Body(client, parameters, index, state, friction)
            for index, state in enumerate(origin.states)
        ]
        if len(self.tables) > 1:
            self._part_tables()
        self.arm.set_friction(parameters.tool_friction / friction)

    def _build_tables(self, table: Table) -> list[int]:
        """Build the table as a box down to the floor, once for each body where they differ.

        A body has one friction in Bullet, and one stiffness. So each has a table of its own where
        the table has patches, with the friction at the body's place, or where bodies lie flat:
        their supports share the load by how deep they sink, as those of an elastic bottom do.
        """
        parameters = self._parameters
        roughness, flat = parameters.roughness, parameters.lies_flat
        half, middle = table_box(table)
        number = parameters.count if roughness.patches or flat else 1
        tables = self._boxes(half, [middle] * number, self._table_friction)
        if roughness.grain != 1.0:
            across = roughness.grain**0.5  # keeps the mean of both directions
            for one in tables:
                self._client.changeDynamics(one, -1, anisotropicFriction=[1 / across, across, 1.0])
        for body, one in enumerate(tables if flat else ()):
            share = parameters.masses[body] / len(parameters.supports(body))
            self._client.changeDynamics(
                one,
                -1,
                contactStiffness=share * GRAVITY / SAG,
                contactDamping=2.0 * share * sqrt(GRAVITY / SAG),  # critical
            )
        return tables

    def _part_tables(self) -> None:
        """Let each body touch only its own table: of no two bodies both bits are the same."""
        client = self._client
        for index, (table, body) in enumerate(zip(self.tables, self.bodies, strict=True)):
            mine, its = 1 << (8 + index % 8), 1 << (16 + (index + index // 8) % 8)
            client.setCollisionFilterGroupMask(table, -1, mine, its)
            client.setCollisionFilterGroupMask(body.id, -1, its | 1, ~TABLE_BITS | mine)

    def _build_floor(self, table: Table) -> None:
        """Build the floor at the height of the arm's base, for bodies that fall."""
        drop = max(table.height, THINNEST_TABLE)
        half = [FLOOR_SIZE, FLOOR_SIZE, FLOOR_THICKNESS / 2]
        self._boxes(half, [[0.0, 0.0, -drop - FLOOR_THICKNESS / 2]], friction=1.0)

    def _boxes(self, half: list[float], middles: list[list[float]], friction: float) -> list[int]:
        """Build boxes with these half sides at some places, in one call: it takes that of one."""
        client = self._client
        bodies: tuple[int, ...] = client.createMultiBody(
            baseMass=0.0,
            baseCollisionShapeIndex=client.createCollisionShape(client.GEOM_BOX, halfExtents=half),
            baseVisualShapeIndex=unseen_shape(client),
            batchPositions=middles,
        )
        for body in bodies:
            client.changeDynamics(body, -1, lateralFriction=friction, restitution=0.0)
        return list(bodies)

    def disturb(self, before: bytes) -> None:
        """Do nothing: a world with noise is refused for Bullet, see `sain_sim.world.truth`."""

    def states(self) -> list[BodyState]:
        """Return the bodies' states."""
        return [body.state() for body in self.bodies]

    def scene(self, states: list[BodyState]) -> Scene:
        """Return the scene (N, 8) of bodies in these states."""
        rows = zip(self.bodies, states, strict=True)
        return np.array([(*body.planar(state), body.mass, body.radius) for body, state in rows])

    def heights(self, states: list[BodyState]) -> Scalars:
        """Return how high the middles of bodies in these states are, (N,) [m]."""
        return np.array([state.position[2] for state in states])

    def leans(self, states: list[BodyState]) -> Scalars:
        """Return how far bodies in these states are tipped out of the plane, (N,) [rad]."""
        return lean_of(np.array([state.orientation for state in states])[:, :2])

    def advance(self) -> None:
        """Simulate one control step."""
        roughness = self._parameters.roughness
        for table, body in zip(self.tables, self.bodies, strict=True) if roughness.patches else ():
            x, y, _ = body.place()
            friction = self._table_friction * roughness.friction_factor(x, y)
            self._client.changeDynamics(table, -1, lateralFriction=friction)
        if self.arm.spring is not None:
            self.arm.spring.pull()
        self._client.stepSimulation()

    def touched(self, pushed: int) -> int | None:
        """Return the first body but the pushed one that the tool touches, if any."""
        for index, body in enumerate(self.bodies):
            if index == pushed:
                continue
            for contact in self._client.getContactPoints(self.arm.body, body.id, self.arm.stick):
                distance, force = contact[8], contact[9]
                if distance <= 0.0 or force > 0.0:
                    return index
        return None
