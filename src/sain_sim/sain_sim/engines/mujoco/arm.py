"""The Panda in MuJoCo: set to a pose, or moved along tool tips by its servos."""

from typing import Any

import mujoco
import numpy as np

from sain_sim.arm.controlled import JOINT_COUNT, ControlledArm
from sain_sim.arm.kinematics import Joints, Kinematics, Tips
from sain_sim.engines.mujoco.description import STICK


class MujocoArm(ControlledArm):
    """A Panda of MuJoCo's, whose joints are the first seven of the model."""

    def __init__(self, model: Any, data: Any, kinematics: Kinematics, time_step: float) -> None:
        """Control the arm of a world's data; each command holds for one time_step [s]."""
        super().__init__(kinematics, time_step)
        self._model, self._data = model, data
        self._stick = model.geom(STICK).id
        # A servo's damping brakes all motion. This lead cancels it at the speed that is commanded;
        # the half step is from where a control step begins to its middle.
        _, stiffness, damping = -model.actuator_biasprm[:, :3].T
        self._lead = damping / stiffness + time_step / 2  # (7,) [s]

    def put(self, joints: Joints) -> None:
        """Set the joints to angles (7,) at once, at rest."""
        self._data.qpos[:JOINT_COUNT] = joints
        self._data.qvel[:JOINT_COUNT] = 0.0

    def command(self, joints: list[float], speeds: list[float]) -> None:
        """Command angles of now (7) [rad], and speeds (7) [rad/s] that lead to the next ones."""
        self._data.ctrl[:] = np.array(joints) + self._lead * np.array(speeds)

    def joint_states(self) -> tuple[Joints, Joints]:
        """Return the joint angles (7,) [rad] and speeds (7,) [rad/s]."""
        return self._data.qpos[:JOINT_COUNT].copy(), self._data.qvel[:JOINT_COUNT].copy()

    def tool(self) -> Tips:
        """Return where the tool's tip is, (3,) [m]: below the middle of the stick's round end."""
        mujoco.mj_kinematics(self._model, self._data)
        radius = self._model.geom_size[self._stick, 0]
        return np.asarray(self._data.geom_xpos[self._stick] - [0.0, 0.0, radius])
