"""An arm, a table and bodies in MuJoCo. Its physics is not that of `sain_sim` or of any model.

Bodies lie on flat bottoms, as cylinders, boxes and hulls that touch the table where MuJoCo finds
contacts. Friction and centres of mass are drawn. Links collide. What breaks a limit, and what
touches what, is counted here, from the simulation alone.
"""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any, Final

import mujoco
import numpy as np

from sain_arm.laboratory.laboratory_config import LaboratoryConfig
from sain_arm.robot.arm_model import BODY, TABLE, ArmModel, robot_spec, solid_geoms
from sain_arm.robot.robot import Robot, Vector
from sain_arm.robot.urdf import ROD, TIP
from sain_core.randomness import generator
from sain_core.scene import DISK_HEIGHT, POSE, VELOCITY, is_settled, wrap_angle
from sain_core.shapes.body_file import BodyFile, Poses
from sain_core.types import Scene

STEP: Final = 0.002  # [s]
STIFFNESS: Final = 60.0**2  # [1/s^2], of the joints' servos
DAMPING: Final = 2.0 * 60.0  # [1/s], critical
SLACK: Final = 0.02  # of a limit of speed, by which servos may overshoot
EDGE: Final = 0.002  # [rad], likewise of a position limit


@dataclass
class Report:
    """What an episode broke.

    Attributes:
        limits: how often a joint passed a limit of position or speed, by the joint's name.
        contacts: how many steps two things touched that must not, by their names.
        tool: steps in which the tool touched a body.
    """

    limits: Counter[str] = field(default_factory=Counter)
    contacts: Counter[str] = field(default_factory=Counter)
    tool: int = 0


class Cell:
    """The simulated laboratory; its clock is the sum of its steps."""

    def __init__(
        self, robot: Robot, bodies: BodyFile, config: LaboratoryConfig = LaboratoryConfig()
    ) -> None:
        """Draw what is unknown, with the arm at home and the bodies in a row."""
        self.robot, self.bodies = robot, bodies
        self._random = generator(config.seed, "laboratory")
        self.model = self._built(ArmModel(robot), config)
        self.data = mujoco.MjData(self.model)
        joints = [self.model.joint(name) for name in robot.joints]
        self._positions = np.array([joint.qposadr[0] for joint in joints])
        self._speeds = np.array([joint.dofadr[0] for joint in joints])
        self._free = [self.model.body(f"{BODY}{n}").jntadr[0] for n in range(len(bodies.names))]
        self._inertia = np.zeros((self.model.nv, self.model.nv))
        self._names = [self.model.body(index).name for index in range(self.model.nbody)]
        self.report = Report()
        self.home()

    @property
    def time(self) -> float:
        """The time [s]."""
        return float(self.data.time)

    @property
    def joints(self) -> Vector:
        """The joints' positions (J,)."""
        return np.array(self.data.qpos[self._positions])

    @property
    def velocities(self) -> Vector:
        """The joints' velocities (J,)."""
        return np.array(self.data.qvel[self._speeds])

    @property
    def tip(self) -> np.ndarray:
        """Where the tool's tip is (3,) [m]."""
        return np.array(self.data.body(TIP).xpos)

    def home(self) -> None:
        """Put the arm at home, at rest."""
        self.set(self.data, self.robot.home, self.observe()[:, POSE])
        self.data.qvel[self._speeds] = 0.0
        mujoco.mj_forward(self.model, self.data)

    def place(self, poses: Poses) -> None:
        """Put the bodies to poses (N, 3), at rest."""
        self.set(self.data, self.joints, poses)
        for joint in self._free:
            speed = self.model.jnt_dofadr[joint]
            self.data.qvel[speed : speed + 6] = 0.0
        mujoco.mj_forward(self.model, self.data)

    def set(self, data: Any, joints: Vector, poses: Poses) -> None:
        """Write joints (J,) and poses (N, 3) of bodies that lie on the table to data."""
        data.qpos[self._positions] = joints
        for joint, (x, y, theta) in zip(self._free, poses, strict=True):
            start = self.model.jnt_qposadr[joint]
            turn = [np.cos(theta / 2), 0.0, 0.0, np.sin(theta / 2)]
            data.qpos[start : start + 7] = [x, y, DISK_HEIGHT / 2, *turn]

    def observe(self) -> Scene:
        """Return the bodies (N, 8) as they are."""
        poses, speeds = [], []
        for joint in self._free:
            start, speed = self.model.jnt_qposadr[joint], self.model.jnt_dofadr[joint]
            x, y, _, w, _, _, z = self.data.qpos[start : start + 7]
            poses.append((x, y, wrap_angle(np.asarray(2.0 * np.arctan2(z, w)))))
            speeds.append(self.data.qvel[speed : speed + 6][[0, 1, 5]])
        scene = self.bodies.scene(np.array(poses, dtype=float))
        scene[:, VELOCITY] = speeds
        return scene

    @property
    def at_rest(self) -> bool:
        """Whether all bodies rest."""
        return bool(is_settled(self.observe()))

    def step(self, positions: Vector, velocities: Vector) -> None:
        """Simulate one step, with servos towards positions (J,) and velocities (J,)."""
        data, model = self.data, self.model
        mujoco.mj_step1(model, data)
        mujoco.mj_fullM(model, data, self._inertia)
        inertia = self._inertia[np.ix_(self._speeds, self._speeds)]
        error = positions - data.qpos[self._positions]
        lag = velocities - data.qvel[self._speeds]
        torque = inertia @ (STIFFNESS * error + DAMPING * lag)
        data.qfrc_applied[self._speeds] = torque + data.qfrc_bias[self._speeds]
        mujoco.mj_step2(model, data)
        self._watch()

    def _watch(self) -> None:
        robot, data = self.robot, self.data
        joints, speeds = data.qpos[self._positions], np.abs(data.qvel[self._speeds])
        beyond = (joints < robot.lower - EDGE) | (joints > robot.upper + EDGE)
        beyond |= speeds > robot.velocity * (1.0 + SLACK)
        for name in np.array(robot.joints)[beyond].tolist():
            self.report.limits[name] += 1
        for index in range(data.ncon):
            pair = self.model.geom_bodyid[data.contact[index].geom]
            names = sorted(TABLE if body == 0 else self._names[body] for body in pair)
            things = [name for name in names if name == TABLE or name.startswith(BODY)]
            if len(things) == 2:  # bodies, and the table
                continue
            if len(things) == 1 and ROD in names and things[0] != TABLE:
                self.report.tool += 1
            else:
                self.report.contacts[" and ".join(names)] += 1

    def _built(self, arm: ArmModel, config: LaboratoryConfig) -> Any:
        spec = robot_spec(self.robot)
        spec.option.timestep = STEP
        spec.option.jacobian = (
            mujoco.mjtJacobian.mjJAC_DENSE
        )  # as sain_sim.engines.mujoco_description
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.impratio = 10.0
        for first, second in arm.harmless:
            spec.add_exclude(bodyname1=first, bodyname2=second)
        for joint in spec.joints:
            joint.armature = 0.05
            joint.actfrclimited = False
        draw = self._random.uniform
        table, tool = draw(*config.table_friction), draw(*config.tool_friction)
        spec.worldbody.add_geom(
            name=TABLE,
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            size=[3.0, 3.0, 0.1],
            friction=[table, 0.002, 1e-4],
            condim=4,
            priority=1,
        )
        for geom in spec.body(ROD).geoms:
            geom.friction[0], geom.priority, geom.condim = tool, 1, 3
        shapes = zip(self.bodies.bodies.shapes, self.bodies.radii, self.bodies.masses, strict=True)
        for index, (shape, radius, stated) in enumerate(shapes):
            body = spec.worldbody.add_body(name=f"{BODY}{index}", pos=[0.5, 0.2 * index, 0.1])
            body.add_freejoint()
            mass = stated if self.bodies.weighed else draw(*config.mass)
            body.explicitinertial, body.mass = True, mass
            body.ipos = [*draw(-1.0, 1.0, 2) * config.off_centre * radius, 0.0]
            body.inertia = shape.inertia(mass, radius)
            solid_geoms(spec, body, shape, radius)
        return spec.compile()


def settle(cell: Cell, hold: Vector, longest: float = 3.0) -> bool:
    """Simulate until all bodies rest, at most so long [s]; return whether they do."""
    still, end = np.zeros_like(hold), cell.time + longest
    while cell.time < end:
        for _ in range(25):
            cell.step(hold, still)
        if cell.at_rest:
            return True
    return False
