"""Inverse kinematics of ways of the tool: one branch from point to point.

Away from the joints' limits by Newton steps, as many as are needed; near them by mink.

The tool points down; its turn about its own axis is free. Of the joint angles that remain possible
those near home are preferred, so that a place has one posture in a branch, whatever came before.
"""

from typing import Final

import mink
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_arm.robot.arm_model import ArmModel
from sain_arm.robot.robot import Joints, Vector
from sain_arm.robot.urdf import TIP
from sain_core.errors import UnreachableError

Tips = Float[ndarray, "T 3"]  # [m] in the world

CLOSE: Final = 3e-5  # [m], error of the tip
UPRIGHT: Final = 1e-3  # [rad], error of the tool's direction
SMOOTH: Final = 0.1  # of both, with Newton steps: errors from point to point would bend a way
STEPS: Final = 30  # of the solver for the next point of a way
FIRST_STEPS: Final = 80  # and for its first point
JUMP: Final = 0.35  # [rad], of a joint between two points of a way: more is another branch
POSTURE_COST: Final = 1e-3  # of an angle away from home; 1 is that of a metre
TILT_COST: Final = 0.3
DAMPING: Final = 1e-7
SOFT: Final = DAMPING * np.eye(5)


class Kinematics:
    """Finds joint angles for ways of the tool's tip."""

    def __init__(self, arm: ArmModel) -> None:
        """Solve for this arm."""
        self.arm = arm
        self._configuration = mink.Configuration(arm.model)
        self._task = mink.FrameTask(
            TIP, "body", position_cost=1.0, orientation_cost=[TILT_COST, TILT_COST, 0.0]
        )
        self._posture = mink.PostureTask(arm.model, cost=POSTURE_COST)
        lower, upper = arm.robot.lower[:, None], arm.robot.upper[:, None]
        arm.model.jnt_range[arm.order] = np.concatenate([lower, upper], axis=1)
        arm.model.jnt_limited[:] = True
        self._limits = [mink.ConfigurationLimit(arm.model)]

    def follow(
        self,
        start: Vector,
        tips: Tips,
        first_steps: int = FIRST_STEPS,
        posture: Vector | None = None,
    ) -> Joints:
        """Return joints (T, J) along a way, in the branch that joints (J,) lead to.

        Of all that hold the tool alike, they are near a posture (J,), by default home.

        Raises:
            UnreachableError: naming the first point that the arm cannot take, or where the branch
                ends.
        """
        found = np.empty((len(tips), len(start)))
        joints, posture = start, self.arm.robot.home if posture is None else posture
        self._posture.set_target(self._in_model(posture))
        for index, tip in enumerate(tips):
            steps = STEPS if index else first_steps
            joints = self._solve(joints, tip, steps, posture)
            if index and (jump := np.abs(joints - found[index - 1])).max() > JUMP:
                name = self.arm.robot.joints[int(np.argmax(jump))]
                raise UnreachableError(
                    f"joint {name} would jump by {jump.max():.2f} rad at {_place(tip)}: this branch"
                    " of the inverse kinematics ends there"
                )
            found[index] = joints
        return found

    def _solve(
        self, start: Vector, tip: Float[ndarray, "3"], steps: int, posture: Vector
    ) -> Vector:
        """Return joints (J,) near others that hold the tip at a point (3,)."""
        joints = self._newton(start, tip, steps, posture)
        return self._within_limits(start, tip, steps) if joints is None else joints

    def _newton(
        self, joints: Vector, tip: Float[ndarray, "3"], steps: int, posture: Vector
    ) -> Vector | None:
        """Return the same, or None: the way there leads to a limit, or is long."""
        arm, robot, close = self.arm, self.arm.robot, None
        for step in range(steps):
            place, (x, y, _) = arm.tip(joints), arm.axis()
            lean = np.array([-y, x])  # the turn [rad] that brings the tool upright, where small
            off, tilt = np.linalg.norm(tip - place), np.linalg.norm(lean)
            if step and off < CLOSE and tilt < UPRIGHT:
                close = joints
                if off < SMOOTH * CLOSE and tilt < SMOOTH * UPRIGHT:
                    break
            rates = arm.jacobian()[:5]
            rates[3:] *= TILT_COST
            homewards = posture - joints  # as far as it moves nothing of the tool
            rest = np.concatenate([tip - place, TILT_COST * lean]) - rates @ homewards
            way = homewards + rates.T @ np.linalg.solve(rates @ rates.T + SOFT, rest)
            joints = joints + _shortened(way)
            if (joints < robot.lower).any() or (joints > robot.upper).any():
                break
        return close

    def _within_limits(self, start: Vector, tip: Float[ndarray, "3"], steps: int) -> Vector:
        """Return the same, with joints that may be at their limits."""
        configuration = self._configuration
        configuration.update(self._in_model(start))
        self._task.set_target(mink.SE3(np.array([0.0, 1.0, 0.0, 0.0, *tip])))
        for step in range(steps):
            error = self._task.compute_error(configuration)
            close = np.linalg.norm(error[:3]) < CLOSE and np.linalg.norm(error[3:5]) < UPRIGHT
            if close and step:
                break
            try:
                velocity = mink.solve_ik(
                    configuration,
                    (self._task, self._posture),
                    1.0,
                    "daqp",
                    damping=DAMPING,
                    limits=self._limits,
                )
            except mink.NoSolutionFound as failure:
                raise UnreachableError(f"no inverse kinematics at {_place(tip)}") from failure
            configuration.integrate_inplace(_shortened(velocity), 1.0)
        joints = configuration.q[self.arm.order]
        error = self._task.compute_error(configuration)
        off, tilt = np.linalg.norm(error[:3]), np.linalg.norm(error[3:5])
        if off > CLOSE or tilt > UPRIGHT:
            raise UnreachableError(
                f"no inverse kinematics at {_place(tip)}: the tip would be {1e3 * off:.1f} mm off"
                f" and the tool {tilt:.2f} rad from upright{self._at_limit(joints)}"
            )
        return joints

    def _at_limit(self, joints: Vector) -> str:
        robot = self.arm.robot
        near = np.minimum(joints - robot.lower, robot.upper - joints) < 1e-3
        names = [name for name, is_near in zip(robot.joints, near, strict=True) if is_near]
        return f"; at its limit: {', '.join(names)}" if names else ""

    def _in_model(self, joints: Vector) -> Vector:
        ordered = np.empty_like(joints)
        ordered[self.arm.order] = joints
        return ordered


def _shortened(step: ndarray, longest: float = 0.5) -> ndarray:
    """Return a step [rad] of the solver, shortened where linearisation does not hold."""
    return step * min(1.0, longest / max(float(np.abs(step).max()), 1e-12))


def _place(tip: Float[ndarray, "3"]) -> str:
    return f"({tip[0]:.3f}, {tip[1]:.3f}, {tip[2]:.3f}) m"
