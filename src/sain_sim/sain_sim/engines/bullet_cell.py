"""A workcell in PyBullet: the arm in it, and its control steps."""

from math import sqrt
from typing import Final

import numpy as np

from sain_core.scene import Table
from sain_core.types import Scalars, Scene
from sain_sim.engines.bullet_arm import ArmFile, BulletArm
from sain_sim.engines.bullet_bodies import (
    Body,
    BodyState,
    check_simulated,
    resting,
    unseen_shape,
)
from sain_sim.engines.bullet_client import Client
from sain_sim.world.parameters import FLOOR_SIZE, THINNEST_TABLE, WorldParameters, table_box
from sain_sim.world.workcell import (
    GRAVITY,
    SAG,
    TIME_STEP,
    CellState,
    Simulation,
    Workcell,
    WorldConfig,
    lean_of,
)

CONTACT_BREAKING: Final = 0.001  # [m]; Bullet's 0.02 keeps contacts of rims that slid apart
TABLE_BITS: Final = 0xFF00  # of the collision groups of tables that are one body's alone
FLOOR_THICKNESS: Final = 0.05  # [m]


class BulletSimulation(Simulation):
    """A physics server, and the descriptions of the arms that it loads."""

    def __init__(self, config: WorldConfig) -> None:
        """Connect to a server of its own."""
        super().__init__(config)
        self.client = Client()
        self._files: dict[bool, ArmFile] = {}  # with a rigid tool, and with one on a spring

    def resting(self, scene: Scene, parameters: WorldParameters) -> list[BodyState]:
        """Return the states of bodies that stand at rest where a scene (N, 8) has them.

        Raises:
            ConfigError: a body of another height, or of more convex parts than Bullet takes.
        """
        check_simulated(parameters)
        rows = zip(scene, parameters.mass_offsets, strict=True)
        return [resting(self.client, state, offset) for state, offset in rows]

    def build(self, parameters: WorldParameters, origin: CellState, steps: int) -> "BulletCell":
        """Build a workcell with these bodies, after so many earlier control steps."""
        sprung = parameters.roughness.spring > 0.0
        if sprung not in self._files:  # each description is written once
            self._files[sprung] = ArmFile(self.planner.arm, self.config.rise, sprung)
        return BulletCell(self, self._files[sprung], parameters, origin, steps)

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

    arm: BulletArm

    def __init__(
        self,
        simulation: BulletSimulation,
        file: ArmFile,
        parameters: WorldParameters,
        origin: CellState,
        steps: int,
    ) -> None:
        """Empty the client and build everything in it, the bodies in the origin's states."""
        config = simulation.config
        super().__init__(config, parameters, origin, steps)
        self._client = client = simulation.client
        table, rough = config.feasibility.table, parameters.roughness
        client.resetSimulation()
        client.setGravity(*rough.gravity(GRAVITY))
        client.setTimeStep(TIME_STEP)
        client.setPhysicsEngineParameter(
            deterministicOverlappingPairs=1, contactBreakingThreshold=CONTACT_BREAKING
        )
        spring = rough.spring, rough.stock_joints, config.rise
        self.arm = BulletArm(client, file, simulation.planner.arm, spring)
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
            for contact in self._client.getContactPoints(
                self.arm.body, body.id, self.arm.tool_link
            ):
                distance, force = contact[8], contact[9]
                if distance <= 0.0 or force > 0.0:
                    return index
        return None
