"""The disks and what they stand on, as Bullet bodies."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from sain_core.scene import (
    OMEGA,
    SETTLED_SPEED,
    SETTLED_SPIN,
    STATE_SIZE,
    VX,
    VY,
    Table,
    X,
    Y,
)
from sain_core.types import Mask, Scene
from sain_sim.client import Client
from sain_sim.disks import REGULAR_FEET, BodyState, Build, Disk, turned, unseen_shape
from sain_sim.parameters import WorldParameters

FLOOR_SIZE: Final = 3.0  # [m], half its side
FLOOR_THICKNESS: Final = 0.05  # [m]
TABLE_GROUP: Final = 8  # first bit of the collision groups of tables that are one disk's alone
DISK_GROUP: Final = 16  # ... and of their disks
FALLEN_HEIGHT: Final = -0.01  # [m], a disk whose middle is lower has left the table


class Stage:
    """Table, floor and disks of one world.

    Bullet multiplies the friction coefficients of two bodies. Those of the single bodies are
    chosen so that the products are what the parameters say of table, rims and tool.
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
        self._columns = np.array([parameters.masses, parameters.radii]).T  # (N, 2)
        friction = parameters.rim_friction**0.5  # of a disk alone
        self.tool_friction = parameters.tool_friction / friction
        self.table_friction = parameters.friction / friction  # of a table alone
        self._roughness = parameters.roughness
        self.tables = self._build_tables(table, parameters)
        self.floor = self._build_floor(table)
        self.disks = [
            Disk(client, build, state, friction)
            for build, state in zip(_builds(parameters), states, strict=True)
        ]
        if len(self.tables) > 1:
            self._part_tables()

    def states(self) -> list[BodyState]:
        """Return everything there is to know of the disks."""
        return [disk.state() for disk in self.disks]

    def before_step(self) -> None:
        """Give each disk the friction of the place where it is, if the table has patches."""
        if not self._roughness.patches:
            return
        for table, disk in zip(self.tables, self.disks, strict=True):
            x, y, _ = disk.place()
            factor = self._roughness.friction_factor(x, y)
            self._client.changeDynamics(table, -1, lateralFriction=self.table_friction * factor)

    def _build_tables(self, table: Table, parameters: WorldParameters) -> list[int]:
        """Build the table, once for each disk if it has patches.

        Bullet knows one friction of a body. Each disk so has a table of its own at the same
        place, with the friction that the table has where the disk is.
        """
        count = parameters.count if self._roughness.patches else 1
        return [self._build_table(table) for _ in range(count)]

    def _part_tables(self) -> None:
        """Let each disk touch its own table and no other's."""
        others = sum(1 << (TABLE_GROUP + disk) for disk in range(len(self.disks)))
        for index, (table, disk) in enumerate(zip(self.tables, self.disks, strict=True)):
            mine, its = 1 << (TABLE_GROUP + index), 1 << (DISK_GROUP + index)
            self._client.setCollisionFilterGroupMask(table, -1, mine, its)
            self._client.setCollisionFilterGroupMask(disk.body, -1, its | 1, ~others | mine)

    def _build_table(self, table: Table) -> int:
        """Build the table top as a box that reaches down to the floor."""
        half = [
            (table.x_max - table.x_min) / 2,
            (table.y_max - table.y_min) / 2,
            max(table.height, FLOOR_THICKNESS) / 2,
        ]
        middle = [(table.x_min + table.x_max) / 2, (table.y_min + table.y_max) / 2, -half[2]]
        body = _box(self._client, half, middle)
        self._client.changeDynamics(body, -1, lateralFriction=self.table_friction, restitution=0.0)
        if self._roughness.grain != 1.0:
            across = self._roughness.grain**0.5  # the mean of both directions stays what it is
            self._client.changeDynamics(body, -1, anisotropicFriction=[1 / across, across, 1.0])
        return body

    def _build_floor(self, table: Table) -> int:
        """Build the floor at the height of the arm's base; it catches what falls."""
        drop = max(table.height, FLOOR_THICKNESS)
        half = [FLOOR_SIZE, FLOOR_SIZE, FLOOR_THICKNESS / 2]
        body = _box(self._client, half, [0.0, 0.0, -drop - FLOOR_THICKNESS / 2])
        self._client.changeDynamics(body, -1, lateralFriction=1.0, restitution=0.0)
        return body

    def scene(self, states: Sequence[BodyState]) -> Scene:
        """Return the scene (N, 8) of disks in these states."""
        scene = np.empty((len(self.disks), STATE_SIZE))
        for row, disk, state, columns in zip(scene, self.disks, states, self._columns, strict=True):
            heading = self._client.getEulerFromQuaternion(state.orientation)[2]
            row[:] = *state.position[:2], heading, *state.velocity[:2], state.spin[2], *columns
            if disk.build.mass_offset != (0.0, 0.0):  # a body's place is its centre of mass
                x, y = turned(disk.build.mass_offset, heading)
                row[[X, Y, VX, VY]] += -x, -y, y * row[OMEGA], -x * row[OMEGA]
        return scene

    def fallen(self) -> Mask:
        """Tell which disks (N,) have left the table."""
        return np.array([disk.state().position[2] < FALLEN_HEIGHT for disk in self.disks])

    def still(self) -> bool:
        """Tell whether every disk on the table is settled; what fell off does not count."""
        states = self.states()
        scene = self.scene(states)
        slow = np.hypot(scene[:, VX], scene[:, VY]) < SETTLED_SPEED
        slow &= np.abs(scene[:, OMEGA]) < SETTLED_SPIN
        return all(
            settled or state.position[2] < FALLEN_HEIGHT
            for settled, state in zip(slow, states, strict=True)
        )

    def touched_by(self, body: int, link: int) -> int | None:
        """Return the first disk but the mid disk that a body's link touches, if any."""
        for index in range(1, len(self.disks)):
            for contact in self._client.getContactPoints(body, self.disks[index].body, link):
                distance, force = contact[8], contact[9]
                if distance <= 0.0 or force > 0.0:
                    return index
        return None


def _builds(parameters: WorldParameters) -> list[Build]:
    """Return how each disk is made."""
    feet = parameters.roughness.feet or (REGULAR_FEET,) * parameters.count
    columns = (parameters.shapes, parameters.masses, parameters.radii)
    return [Build(*row) for row in zip(*columns, parameters.mass_offsets, feet, strict=True)]


def _box(client: Client, half: list[float], middle: list[float]) -> int:
    body: int = client.createMultiBody(
        baseMass=0.0,
        baseCollisionShapeIndex=client.createCollisionShape(client.GEOM_BOX, halfExtents=half),
        baseVisualShapeIndex=unseen_shape(client),
        basePosition=middle,
    )
    return body
