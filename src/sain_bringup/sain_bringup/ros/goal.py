"""``ros2 run sain_bringup goal``: one goal by hand, how it goes, and how it ended."""

import math
import time
from collections.abc import Callable
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.action import ActionClient
from rclpy.node import Node
from rich.console import Console
from rich.markup import escape

from sain_bringup.options import GoalOptions
from sain_core.cli.terminal import WaitingLine
from sain_core.errors import ErrorCode, SainError
from sain_core.ros.diagnostics import node_of
from sain_core.ros.ending import release
from sain_core.ros.node_main import NAMESPACE, ros_context, spin_until
from sain_core.ros.qos import RELIABLE
from sain_interfaces.action import Reach
from sain_interfaces.msg import Goal, GoalPose, Plan
from sain_model.compute.kernel_store import describe_compilation

NOT_REACHED: Final = 1
PATIENCE: Final = 1.0  # [s] before a line says what is waited for
LOOK: Final = 0.25  # [s] between looks how far that is
WAITS: Final = "waits for"  # begins what a planner says that cannot plan yet
ENDINGS: Final = {Plan.EXHAUSTED: "all pushes were sent", Plan.NO_PUSH: "no push is left to try"}


class SilentPlannerError(SainError):
    """The planner does not answer."""


class GoalSender(Node):
    """Sends one goal by the action, and prints what the planner says."""

    def __init__(self, console: Console) -> None:
        """Look for the planner."""
        super().__init__("goal", namespace=NAMESPACE)
        self._console = console
        self._client = ActionClient(self, Reach, "reach")
        self._planner = self.resolve_topic_name("mppi_node")
        self._line = WaitingLine(console, PATIENCE)
        told = self._on_diagnostics
        self.create_subscription(DiagnosticArray, "/diagnostics", told, RELIABLE)

    def send(self, goal: Goal, timeout_s: float) -> Any:
        """Send a goal; return its handle.

        Raises:
            SilentPlannerError: no planner, or no answer in time.
        """
        where = self.resolve_topic_name("reach")
        waited = f"(waited {timeout_s:g} s)"
        if not self._wait(self._client.server_is_ready, timeout_s, f"a planner on {where}"):
            raise SilentPlannerError(f"no planner on {where} {waited}; start mppi_node")
        sent = self._client.send_goal_async(Reach.Goal(goal=goal), self._tell)
        if not self._wait(sent.done, timeout_s, f"the answer of the planner on {where}"):
            raise SilentPlannerError(f"the planner did not answer on {where} {waited}")
        return sent.result()

    def _wait(self, done: Callable[[], bool], timeout_s: float, what: str) -> bool:
        """Wait, and show for what; tell whether it came. Time for compiling kernels is extra."""
        end = time.monotonic() + timeout_s
        with self._line:
            while not spin_until(self, done, LOOK):
                if compilation := describe_compilation():
                    end = time.monotonic() + timeout_s
                elif time.monotonic() >= end:
                    return False
                more = f": {compilation}" if compilation else f", at most {timeout_s:g} s"
                self._line.say(f"waiting for {what}{more}")
        return True

    def result(self, handle: Any) -> Reach.Result:
        """Wait for the end of a goal; Ctrl-C cancels it."""
        ended = handle.get_result_async()
        try:
            with self._line:
                spin_until(self, ended.done, math.inf)
        except KeyboardInterrupt:
            self._console.print("cancelled; a push that is under way is executed to its end")
            handle.cancel_goal_async()
            spin_until(self, ended.done, math.inf)
        return ended.result().result

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        """Show what the planner waits for, or that it does not."""
        for status in message.status:
            if node_of(status) == self._planner:
                waits = status.message.startswith(WAITS)
                self._line.say(f"the planner {status.message}" if waits else "")

    def _tell(self, message: Any) -> None:
        told = message.feedback
        place = f"{1e3 * told.goal_distance:.0f} mm"
        turn = f", {math.degrees(told.goal_turn):.0f}°" if told.goal_turn else ""
        self._console.print(f"push {told.pushes} from {place}{turn} to the goal", highlight=False)


def goal_message(options: GoalOptions) -> Goal:
    """Return the goal that the options ask for."""
    goal = Goal(
        x=options.x, y=options.y, tolerance=options.tolerance, max_pushes=options.max_pushes
    )
    if options.body is not None or options.heading is not None:
        pose = GoalPose(x=options.x, y=options.y, tolerance=options.tolerance)
        pose.body = 1 if options.body is None else options.body
        pose.has_heading = options.heading is not None
        pose.heading = options.heading or 0.0
        goal.poses = [pose]
    return goal


def run(options: GoalOptions, console: Console) -> int:
    """Send the goal, follow it to its end, and return the exit code."""
    with ros_context():
        sender = GoalSender(console)
        try:
            result = sender.result(sender.send(goal_message(options), options.timeout))
        finally:
            release(sender)
    count = f"{result.pushes} push{'' if result.pushes == 1 else 'es'}"
    where = f"{1e3 * result.goal_distance:.1f} mm"
    if result.status == Plan.REACHED:
        console.print(f"[green]reached[/] with {count}, {where} from the goal", highlight=False)
        return 0
    why = result.error_message or ENDINGS.get(result.status, "the planner gave up")
    after = f"; {count}, {where} away" if result.pushes else ""
    console.print(f"[red]not reached[/]: {escape(why)}{after}", highlight=False, soft_wrap=True)
    code = int(result.error_code)
    return NOT_REACHED if code in (0, int(ErrorCode.OK)) else code
