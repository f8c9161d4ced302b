"""What `joint_trajectory_controller` does of a goal: follows, tolerates, aborts. No middleware."""

from typing import Final

import numpy as np

from sain_arm.laboratory.laboratory_config import LaboratoryConfig
from sain_arm.planning.push_events import Ended, Ending
from sain_arm.planning.timing import Trajectory
from sain_arm.robot.robot import Robot, Vector

STOP_TIME: Final = 0.15  # [s], from a cancelled goal to rest


class Controller:
    """Follows one goal at a time, by a clock of its own."""

    def __init__(self, robot: Robot, config: LaboratoryConfig, joints: Vector) -> None:
        """Hold joints (J,)."""
        self._robot, self._config = robot, config
        self._hold = joints.copy()
        self._goal: Trajectory | None = None
        self._began = 0.0
        self._goals = 0
        self._braking: tuple[Vector, Vector, float] | None = None

    @property
    def busy(self) -> bool:
        """Whether a goal is followed."""
        return self._goal is not None

    def start(self, goal: Trajectory, time: float) -> None:
        """Follow a goal from a time [s] on."""
        self._goal, self._began = goal, time + self._config.delay
        self._goals += 1
        self._braking = None

    def stop(self, time: float) -> None:
        """Give up the goal and come to rest."""
        if self._goal is not None:
            position, velocity = self._goal.at(max(time - self._began, 0.0))
            self._braking = position, velocity, time
            self._goal = None

    def target(self, time: float) -> tuple[Vector, Vector]:
        """Return positions (J,) and velocities (J,) that the joints should have at a time [s]."""
        if self._goal is not None:
            if time >= self._began:
                position, velocity = self._goal.at(time - self._began)
                self._hold = position
                return position, velocity
        elif self._braking is not None:
            position, velocity, since = self._braking
            share = min((time - since) / STOP_TIME, 1.0)
            self._hold = position + velocity * STOP_TIME * (share - 0.5 * share**2)
            return self._hold, velocity * (1.0 - share)
        return self._hold, np.zeros_like(self._hold)

    def ending(self, joints: Vector, time: float) -> Ending | None:
        """Return how the goal ended for joints (J,); None: it goes on."""
        goal, config = self._goal, self._config
        if goal is None:
            return None
        since = time - self._began
        faulty = config.abort_at > 0.0 and self._goals % config.abort_every == 0
        if faulty and since >= config.abort_at:
            self.stop(time)
            return Ending(Ended.ABORTED, "protective stop")
        error = np.abs(joints - self._hold)
        joint = self._robot.joints[int(np.argmax(error))]
        if since < goal.duration:
            if error.max() <= config.path_tolerance:
                return None
            self.stop(time)
            return Ending(Ended.ABORTED, f"joint {joint} is {error.max():.3f} rad off its path")
        if error.max() <= config.goal_tolerance:
            self._goal, self._hold = None, goal.positions[-1]
            return Ending(Ended.SUCCEEDED)
        if since <= goal.duration + config.goal_time:
            return None
        self.stop(time)
        return Ending(Ended.ABORTED, f"joint {joint} ended {error.max():.3f} rad off its goal")
