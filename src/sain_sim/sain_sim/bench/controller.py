"""What `joint_trajectory_controller` does of a goal: follows, tolerates, aborts. No middleware."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from sain_arm.planning.push_events import Ended, Ending
from sain_arm.planning.timing import Trajectory
from sain_arm.robot.robot import Robot, Vector
from sain_core.config import Config, option
from sain_sim.bench.faults import FROZEN, Faults

STOP_TIME: Final = 0.15  # [s], from a cancelled goal to rest


@dataclass(frozen=True)
class ControllerConfig(Config):
    """How exactly the controller follows."""

    latency: float = option(
        0.02, "from the acceptance of a goal to its motion", unit="s", minimum=0.0, maximum=2.0
    )
    path_tolerance: float = option(
        0.15, "error of a joint that aborts a goal", unit="rad", minimum=1e-3
    )
    goal_tolerance: float = option(0.01, "error of a joint at the end", unit="rad", minimum=1e-4)
    goal_time: float = option(1.0, "for the joints to come that near", unit="s", minimum=0.0)


class Controller:
    """Follows one goal at a time, by a clock of its own."""

    def __init__(
        self, robot: Robot, joints: Vector, config: ControllerConfig, faults: Faults
    ) -> None:
        """Hold joints (J,)."""
        self._robot, self._config, self._faults = robot, config, faults
        self._hold = joints.copy()
        self._goal: Trajectory | None = None
        self._began = self._goals = 0.0
        self._braking: tuple[Vector, Vector, float] | None = None
        self._frozen_until = self._dark_until = 0.0

    @property
    def busy(self) -> bool:
        """Whether a goal is followed."""
        return self._goal is not None

    @property
    def is_faulty(self) -> bool:
        """Whether the latest goal is one of those with faults."""
        return self._goals > 0 and self._goals % self._faults.every == 0

    def rejects(self) -> bool:
        """Count a goal; return whether it is one to be rejected."""
        self._goals += 1
        return self._faults.reject and self.is_faulty

    def start(self, goal: Trajectory, time: float) -> None:
        """Follow a goal that was counted, from a time [s] on."""
        self._goal, self._braking = goal, None
        self._began = time + self._config.latency + self._faults.delay
        if self.is_faulty:
            self._dark_until = time + self._faults.dark

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

    def is_frozen(self, time: float) -> bool:
        """Tell whether joint states stay as they were, by a fault."""
        freeze = self._faults.freeze
        if freeze > 0.0 and self.busy and self.is_faulty and time - self._began >= freeze:
            self._frozen_until = max(self._frozen_until, self._began + freeze + FROZEN)
        return time < self._frozen_until

    def is_dark(self, time: float) -> bool:
        """Tell whether the camera sees nothing, by a fault."""
        return time < self._dark_until

    def ending(self, joints: Vector, time: float) -> Ending | None:
        """Return how the goal ended for joints (J,); None: it goes on."""
        goal, config, abort = self._goal, self._config, self._faults.abort
        if goal is None:
            return None
        since = time - self._began
        if abort > 0.0 and self.is_faulty and since >= abort:
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
