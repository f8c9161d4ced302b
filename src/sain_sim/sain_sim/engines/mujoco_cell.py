"""A world in MuJoCo: one model for each set of bodies, and data that start anew for every push."""

import logging
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_arm.robot.arm_model import ArmModel
from sain_arm.robot.robot import Vector
from sain_arm.robot.urdf import TIP
from sain_core.scene import THETA, X, Y
from sain_core.types import Scalars, Scene
from sain_core.world import DivergedError
from sain_sim.engines.mujoco_description import (
    FEET_FIRST,
    PHYSICS_STEPS,
    TOOL,
    TOOL_THIRD,
    describe_world,
)
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.roughness import Disturbance
from sain_sim.world.workcell import (
    TIME_STEP,
    CellState,
    ControlledArm,
    Simulation,
    Tip,
    Workcell,
    WorldConfig,
    lean_of,
)

BASE: Final = 1  # what holds the robot, among the bodies of a model
WARNINGS: Final = {
    name: int(kind)
    for name, kind in mujoco.mjtWarning.__members__.items()
    if name != "mjNWARNING"  # their number
}

log = logging.getLogger(__name__)
mujoco.set_mju_user_warning(lambda text: log.debug("%s", text))  # or it writes MUJOCO_LOG.TXT


class MujocoStates(NamedTuple):
    """Where the bodies are and how they move; of a fixed one the velocities are zero."""

    poses: Float[ndarray, "N 7"]  # position [m], quaternion w x y z
    speeds: Float[ndarray, "N 6"]  # in the world [m/s], turning in the body's frame [rad/s]


class MujocoArm(ControlledArm):
    """An arm of MuJoCo's, whose joints are the first ones of the model."""

    def __init__(self, model: Any, data: Any, arm: ArmModel) -> None:
        """Control the arm of a world's data."""
        super().__init__(arm)
        self._data, self._tip = data, model.body(TIP).id
        self._model, self._count = model, len(arm.robot.joints)
        # A servo's damping brakes all motion. This lead cancels it at the speed that is commanded;
        # the half step is from where a control step begins to its middle.
        _, stiffness, damping = -model.actuator_biasprm[:, :3].T
        self._lead = damping / stiffness + TIME_STEP / 2  # (J,) [s]

    def put(self, joints: Vector) -> None:
        """Set the joints to (J,) at once, at rest."""
        self._data.qpos[: self._count] = joints
        self._data.qvel[: self._count] = 0.0

    def command(self, joints: list[float], speeds: list[float]) -> None:
        """Command positions of now (J), and speeds (J) that lead to the next ones."""
        self._data.ctrl[:] = np.array(joints) + self._lead * np.array(speeds)

    def joint_states(self) -> tuple[Vector, Vector]:
        """Return the joints' positions (J,) and speeds (J,)."""
        return self._data.qpos[: self._count].copy(), self._data.qvel[: self._count].copy()

    def tool(self) -> Tip:
        """Return where the tool's tip is, (3,) [m]."""
        mujoco.mj_kinematics(self._model, self._data)
        return np.array(self._data.xpos[self._tip])


class MujocoSimulation(Simulation):
    """The model of the bodies that are simulated now."""

    def __init__(self, config: WorldConfig) -> None:
        """Begin without a model."""
        super().__init__(config)
        self._built: tuple[WorldParameters, Any, Any] | None = None

    def resting(self, scene: Scene, parameters: WorldParameters) -> MujocoStates:
        """Return the states of bodies that stand at rest where a scene (N, 8) has them."""
        poses = np.zeros((len(scene), 7))
        poses[:, 0], poses[:, 1], poses[:, 2] = scene[:, X], scene[:, Y], parameters.tops / 2
        poses[:, 3], poses[:, 6] = np.cos(scene[:, THETA] / 2), np.sin(scene[:, THETA] / 2)
        return MujocoStates(poses, np.zeros((len(scene), 6)))

    def build(self, parameters: WorldParameters, origin: CellState, steps: int) -> "MujocoCell":
        """Build a workcell with these bodies, after so many earlier control steps."""
        if self._built is None or self._built[0] != parameters:
            model = describe_world(self.config, parameters)
            self._built = (parameters, model, mujoco.MjData(model))
        _, model, data = self._built
        arm = MujocoArm(model, data, self.planner.arm)
        return MujocoCell(model, data, arm, self.config, parameters, origin, steps)

    def close(self) -> None:
        """Let go of the model; a second call does nothing."""
        self._built = None


class MujocoCell(Workcell):
    """Data of a model, set to an origin: nothing of earlier pushes is left in them."""

    arm: MujocoArm

    def __init__(
        self,
        model: Any,
        data: Any,
        arm: MujocoArm,
        config: WorldConfig,
        parameters: WorldParameters,
        origin: CellState,
        steps: int,
    ) -> None:
        """Set everything to the origin, at rest and without forces."""
        super().__init__(config, parameters, origin, steps)
        self._model, self._data = model, data
        self._free = np.array([i not in parameters.bodies.fixed for i in range(parameters.count)])
        mujoco.mj_resetData(model, data)
        count, joints = int(self._free.sum()), model.nu
        self._poses = data.qpos[joints:].reshape(count, 7)  # views
        self._speeds = data.qvel[joints:].reshape(count, 6)
        self._fixed_poses = origin.states.poses[~self._free]
        self._poses[:] = origin.states.poses[self._free]
        self._speeds[:] = origin.states.speeds[self._free]
        data.mocap_pos[:], data.mocap_quat[:] = np.split(self._fixed_poses, [3], axis=1)
        self.arm = arm
        self.arm.place(origin.joints)
        self._body_of = model.geom_bodyid - model.body("body0").id  # (G,); below 0: table and arm
        self._is_tool = model.geom_priority == TOOL_THIRD
        model.geom_contype[self._is_tool] = TOOL
        feet = np.flatnonzero(model.geom_priority == FEET_FIRST)
        self._feet = [feet[self._body_of[feet] == body] for body in range(parameters.count)]
        self._slip = np.full(model.ngeom, parameters.friction)
        self._disturb(Disturbance(parameters.roughness.tool_offset, np.ones(len(feet))))

    def states(self) -> MujocoStates:
        """Return the bodies' states."""
        poses, speeds = np.zeros((len(self._free), 7)), np.zeros((len(self._free), 6))
        poses[self._free], speeds[self._free] = self._poses, self._speeds
        poses[~self._free] = self._fixed_poses
        return MujocoStates(poses, speeds)

    def scene(self, states: MujocoStates) -> Scene:
        """Return the scene (N, 8) of bodies in these states."""
        (w, x, y, z), (p, q, r) = states.poses[:, 3:].T, states.speeds[:, 3:].T
        heading = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        # the last row of the rotation matrix: how fast a body turns about the world's z
        spin = 2 * (x * z - w * y) * p + 2 * (y * z + w * x) * q + (1 - 2 * (x * x + y * y)) * r
        rows = (*states.poses[:, :2].T, heading, *states.speeds[:, :2].T, spin)
        about = (self._parameters.masses, self._parameters.radii)
        return np.stack([*rows, *map(np.array, about)], axis=-1)

    def heights(self, states: MujocoStates) -> Scalars:
        """Return how high the middles of bodies in these states are, (N,) [m]."""
        return np.asarray(states.poses[:, 2])

    def leans(self, states: MujocoStates) -> Scalars:
        """Return how far bodies in these states are tipped out of the plane, (N,) [rad]."""
        return lean_of(states.poses[:, 4:6])

    def step(self, positions: Vector, velocities: Vector) -> None:
        """Step as all cells do; only a low tool touches: the ball of a disk is higher than it."""
        is_low = self.arm.tip()[2] < self._parameters.tops.max()
        self._model.geom_contype[self._is_tool] = TOOL if is_low else 0
        super().step(positions, velocities)

    def advance(self) -> None:
        """Simulate one control step.

        Raises:
            DivergedError: MuJoCo reports a problem, or a number that is not finite.
        """
        self._set_patches()
        mujoco.mj_step(self._model, self._data, nstep=PHYSICS_STEPS)
        self._check_finite()

    def touched(self, pushed: int) -> int | None:
        """Return the first body but the pushed one that the tool touches, if any."""
        pairs = self._data.contact.geom  # (C, 2)
        with_tool = self._is_tool[pairs].any(axis=1)
        bodies = self._body_of[pairs[with_tool]].max(axis=1)
        others = bodies[bodies != pushed]
        return int(others.min()) if others.size else None

    def disturb(self, before: bytes) -> None:
        """Draw the noise of a push, by the bytes of what it begins with."""
        count = sum(map(len, self._feet))
        self._disturb(self._parameters.roughness.disturbance(before, count))

    def _disturb(self, disturbance: Disturbance) -> None:
        """Set where the arm's base is, which its joints do not tell, and the feet's friction."""
        model, feet = self._model, np.concatenate(self._feet)
        model.body_pos[BASE, :2] = disturbance.tool
        self._slip[feet] = self._parameters.friction * disturbance.supports
        model.geom_friction[feet, 0] = self._slip[feet]

    def _set_patches(self) -> None:
        """Set the friction of each body's feet to that of its place, if the table has patches."""
        roughness = self._parameters.roughness
        if roughness.patches:
            for feet, (x, y) in zip(self._feet, self.states().poses[:, :2].tolist(), strict=True):
                factor = roughness.friction_factor(x, y)
                self._model.geom_friction[feet, 0] = factor * self._slip[feet]

    def _check_finite(self) -> None:
        """Raise `DivergedError` for a problem that MuJoCo counted, or for NaN or Inf."""
        data = self._data
        problems = [name for name, kind in WARNINGS.items() if data.warning[kind].number]
        if problems or not np.isfinite(data.qacc).all():
            words = ", ".join(problems) or "numbers that are not finite"
            raise DivergedError(f"MuJoCo found no solution of the push: {words}")
