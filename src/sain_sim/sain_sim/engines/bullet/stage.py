"""The disks and what they stand on, as Bullet bodies."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from sain_core.scene import Table
from sain_core.types import Mask, Scene
from sain_sim.arm.client import Client
from sain_sim.engines.bullet.bodies import Body, BodyState
from sain_sim.engines.bullet.collision import Build, unseen_shape
from sain_sim.world.parameters import (
    FLOOR_SIZE,
    THINNEST_TABLE,
    WorldParameters,
    table_box,
)

FLOOR_THICKNESS: Final = 0.05  # [m]
TABLE_GROUP: Final = 8  # first bit of the collision groups of tables that are one disk's alone
DISK_GROUP: Final = 16  # ... and of their disks


class Stage:
    """Table, floor and disks of one world.

    Bullet multiplies the friction coefficients of two bodies. Those of the single bodies are
    chosen so that the products are the parameters' values for table, rims and tool.
    """

    def __init__(
        self,
        client: Client,
        parameters: WorldParameters,
        table: Table,
        states: Sequence[BodyState],
    ) -> None:
        """Build everything in an empty client, the disks in the states (N of them) given."""
        self._client = client
        friction = parameters.rim_friction**0.5  # of a disk alone
        self.tool_friction = parameters.tool_friction / friction
        self.table_friction = parameters.friction / friction  # of a table alone
        self._roughness = parameters.roughness
        self._masses = parameters.masses  # also of fixed bodies, which have none in Bullet
        self.tables = self._build_tables(table, parameters)
        self.floor = self._build_floor(table)
        self.disks = [
            Body(client, build, state, friction)
            for build, state in zip(_builds(parameters), states, strict=True)
        ]
        self._parted = self._part_tables() if len(self.tables) > 1 else []

    def states(self) -> list[BodyState]:
        """Return the states of the disks."""
        return [disk.state() for disk in self.disks]

    def before_step(self) -> None:
        """Set the friction at each disk's place, if the table has patches."""
        for table, disk in self._parted:
            x, y, _ = disk.place()
            friction = self.table_friction * self._roughness.friction_factor(x, y)
            self._client.changeDynamics(table, -1, lateralFriction=friction)

    def _build_tables(self, table: Table, parameters: WorldParameters) -> list[int]:
        """Build the table as a box down to the floor, once for each disk if it has patches.

        A body has one friction in Bullet. Each disk therefore has a table of its own, with the
        friction at the disk's place.
        """
        count = parameters.count if self._roughness.patches else 1
        half, middle = table_box(table)
        bodies = _boxes(self._client, half, [middle] * count, self.table_friction)
        if self._roughness.grain != 1.0:
            across = self._roughness.grain**0.5  # keeps the mean of both directions
            for body in bodies:
                self._client.changeDynamics(body, -1, anisotropicFriction=[1 / across, across, 1.0])
        return bodies

    def _part_tables(self) -> list[tuple[int, Body]]:
        """Let each disk touch only its own table; return each table with its disk."""
        others = sum(1 << (TABLE_GROUP + disk) for disk in range(len(self.disks)))
        parted = list(zip(self.tables, self.disks, strict=True))
        for index, (table, disk) in enumerate(parted):
            mine, its = 1 << (TABLE_GROUP + index), 1 << (DISK_GROUP + index)
            self._client.setCollisionFilterGroupMask(table, -1, mine, its)
            self._client.setCollisionFilterGroupMask(disk.id, -1, its | 1, ~others | mine)
        return parted

    def _build_floor(self, table: Table) -> int:
        """Build the floor at the height of the arm's base, for disks that fall."""
        drop = max(table.height, THINNEST_TABLE)
        half = [FLOOR_SIZE, FLOOR_SIZE, FLOOR_THICKNESS / 2]
        middle = [0.0, 0.0, -drop - FLOOR_THICKNESS / 2]
        return _boxes(self._client, half, [middle], friction=1.0)[0]

    def scene(self, states: Sequence[BodyState]) -> Scene:
        """Return the scene (N, 8) of disks in these states."""
        rows = [
            (*disk.planar(state), mass, disk.build.radius)
            for disk, state, mass in zip(self.disks, states, self._masses, strict=True)
        ]
        return np.array(rows)

    def fallen(self) -> Mask:
        """Tell which disks (N,) have left the table."""
        return np.array([disk.fallen() for disk in self.disks])

    def still(self) -> bool:
        """Tell whether every disk on the table is settled; fallen disks do not count."""
        return all(disk.still() or disk.fallen() for disk in self.disks)

    def touched_by(self, body: int, link: int, pushed: int) -> int | None:
        """Return the first body but the pushed one that another body's link touches, if any."""
        for index, disk in enumerate(self.disks):
            if index == pushed:
                continue
            for contact in self._client.getContactPoints(body, disk.id, link):
                distance, force = contact[8], contact[9]
                if distance <= 0.0 or force > 0.0:
                    return index
        return None


def _builds(parameters: WorldParameters) -> list[Build]:
    """Return how each disk is made."""
    shapes = parameters.body_shapes
    fixed = parameters.bodies.fixed
    masses = [0.0 if body in fixed else mass for body, mass in enumerate(parameters.masses)]
    columns = (masses, parameters.radii, parameters.feet, parameters.mass_offsets)
    return [Build(*row) for row in zip(shapes, *columns, strict=True)]


def _boxes(
    client: Client, half: list[float], middles: list[list[float]], friction: float
) -> list[int]:
    """Build boxes with these half sides at some places, in one call: it takes the time of one."""
    bodies: tuple[int, ...] = client.createMultiBody(
        baseMass=0.0,
        baseCollisionShapeIndex=client.createCollisionShape(client.GEOM_BOX, halfExtents=half),
        baseVisualShapeIndex=unseen_shape(client),
        batchPositions=middles,
    )
    for body in bodies:
        client.changeDynamics(body, -1, lateralFriction=friction, restitution=0.0)
    return list(bodies)
