"""Sends trajectories to a controller of ros2_control, and says once how each ended."""

from collections.abc import Callable
from time import monotonic
from typing import Any, Final

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionClient
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from sain_arm.planning.push_events import Ended, Ending
from sain_arm.planning.timing import Trajectory
from sain_arm.robot.robot import Robot
from sain_core.ros.node_main import steady_timer

LOOK: Final = 0.1  # [s] between looks at the time that a goal takes
SECOND: Final = 1_000_000_000


class TrajectoryClient:
    """One goal at a time. Answers that come late, or twice, are not heard."""

    def __init__(self, node: Node, robot: Robot, patience: float) -> None:
        """Talk to the robot's controller; a goal may take so long [s] more than its trajectory."""
        self._node, self._robot, self._patience = node, robot, patience
        self.name = f"/{robot.controller.strip('/')}/follow_joint_trajectory"
        self._client = ActionClient(node, FollowJointTrajectory, self.name)
        self._goal = 0  # its number; what belongs to another one is late
        self._handle: Any = None
        self._then: Callable[[Ending], None] | None = None
        self._due = 0.0
        self._cancelled, self._why = False, ""
        steady_timer(node, LOOK, self._look)

    @property
    def missing(self) -> str:
        """What to say where no controller serves the action; empty: one does."""
        if self._client.server_is_ready():
            return ""
        return (
            f"no controller serves {self.name}; is it active? ros2 control list_controllers, and"
            " `controller` in the robot's file"
        )

    @property
    def busy(self) -> bool:
        """Whether a goal is under way."""
        return self._then is not None

    def send(self, trajectory: Trajectory, then: Callable[[Ending], None]) -> None:
        """Send a goal; `then` is called once, on the executor's thread."""
        assert not self.busy
        self._goal += 1
        number = self._goal
        self._then, self._handle, self._cancelled, self._why = then, None, False, ""
        self._due = monotonic() + trajectory.duration + self._patience
        goal = FollowJointTrajectory.Goal(trajectory=encode(trajectory, self._robot))
        sent = self._client.send_goal_async(goal)
        sent.add_done_callback(lambda future: self._on_accepted(number, future.result()))

    def cancel(self, why: str = "") -> None:
        """Have the controller stop; the goal ends as it says, or as lost."""
        if not self.busy or self._cancelled:
            return
        self._cancelled, self._why = True, why
        self._due = min(self._due, monotonic() + self._patience)
        if self._handle is not None:
            self._handle.cancel_goal_async()

    def _on_accepted(self, number: int, handle: Any) -> None:
        if number != self._goal or not self.busy:
            if handle.accepted:
                handle.cancel_goal_async()  # it was given up; it must not run
            return
        if not handle.accepted:
            self._end(Ending(Ended.REJECTED))
            return
        self._handle = handle
        if self._cancelled:
            handle.cancel_goal_async()
        future = handle.get_result_async()
        future.add_done_callback(lambda done: self._on_result(number, done.result()))

    def _on_result(self, number: int, answer: Any) -> None:
        if number != self._goal or not self.busy:
            return
        result, text = answer.result, str(answer.result.error_string)
        if answer.status == GoalStatus.STATUS_SUCCEEDED and result.error_code == result.SUCCESSFUL:
            self._end(Ending(Ended.SUCCEEDED))
        elif answer.status == GoalStatus.STATUS_CANCELED:
            self._end(Ending(Ended.CANCELLED, self._why or text))
        else:
            self._end(Ending(Ended.ABORTED, text or f"error code {result.error_code}"))

    def _look(self) -> None:
        if not self.busy or monotonic() < self._due:
            return
        if not self._cancelled:
            self.cancel()  # first it must stop, in case that it still moves
            return
        self._end(Ending(Ended.LOST, f"{self.name} is silent"))

    def _end(self, ending: Ending) -> None:
        then, self._then, self._handle = self._then, None, None
        if then is not None:
            then(ending)


def encode(trajectory: Trajectory, robot: Robot) -> JointTrajectory:
    """Return a trajectory as a message that starts at once."""
    message = JointTrajectory(joint_names=list(robot.joints))
    for time, position, velocity in zip(
        trajectory.times.tolist(), trajectory.positions, trajectory.velocities, strict=True
    ):
        seconds, rest = divmod(round(time * SECOND), SECOND)
        message.points.append(
            JointTrajectoryPoint(
                positions=position.tolist(),
                velocities=velocity.tolist(),
                time_from_start=Duration(sec=seconds, nanosec=rest),
            )
        )
    return message
