"""``ros2 run sain_bringup goal``: one goal by hand, how it goes, and how it ended."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Final

import tyro
from rich.console import Console
from rich.markup import escape

from sain_bringup.waiting import WaitOptions
from sain_core.config import option
from sain_core.errors import ErrorCode
from sain_core.scene import TARGET

if TYPE_CHECKING:
    from rclpy.node import Node

    from sain_interfaces.action import Reach
    from sain_interfaces.msg import Goal

NOT_REACHED: Final = 1
LOOK: Final = 0.5  # [s] between looks for another planner
WAITS: Final = "waits for"  # begins what a planner says that cannot plan yet


@dataclass(frozen=True)
class GoalOptions(WaitOptions):
    """Give the planner a goal, print each push on the way, and how it ended.

    Ctrl-C cancels the goal. Exits with 0 when it was reached, and otherwise with the error code
    or 1.
    """

    place: Annotated[tuple[float, float], tyro.conf.Positional, tyro.conf.arg(metavar="X Y")] = (
        option((0.6, 0.0), "where to, both or none", unit="m")
    )
    heading: float | None = option(None, "of the body; by default any will do", unit="rad")
    body: int = option(
        TARGET,
        "body to bring there, as counted in the scene; a single one is the target, too",
        minimum=0,
        maximum=2**32 - 1,
    )
    tolerance: float = option(
        0.02, "largest distance that counts as reached", unit="m", minimum=1e-4, maximum=0.2
    )
    max_pushes: int = option(30, "pushes after which to give up; 0: never", minimum=0)


class GoalSender:
    """Sends one goal by the action, also to a planner that was restarted; prints what it says."""

    def __init__(self, node: "Node", timeout_s: float, console: Console) -> None:
        from rclpy.action import ActionClient

        from sain_bringup.ros.listener import PLANNER, SCENES, GraphWait
        from sain_interfaces.action import Reach

        self.node = node
        self._console = console
        self._client = ActionClient(self.node, Reach, "reach")
        self._where = self.node.resolve_topic_name("reach")
        self._planners: set[bytes] = set()  # that were there when the goal was sent
        self._before = self._pushes = 0  # for the goal: by planners before, and by all
        parts = PLANNER, SCENES
        self._wait = GraphWait(node, console, timeout_s, parts, waiting=self._on_planner)

    def send(self, goal: "Goal") -> Any:
        """Send a goal; return its handle.

        Raises:
            SilentError: no planner, or no answer in time.
        """
        from sain_interfaces.action import Reach

        self._wait(self._client.server_is_ready, f"a planner on {self._where}")
        self._planners = self._present()
        sent = self._client.send_goal_async(Reach.Goal(goal=goal), self._tell)
        self._wait(sent.done, f"the answer of the planner on {self._where}")
        return sent.result()

    def reach(self, goal: "Goal") -> "Reach.Result":
        """Send a goal, and wait for its end; Ctrl-C cancels it. Raises as `send`."""
        handle = self.send(goal)
        ended = handle.get_result_async()
        try:
            while not self._spin_until(ended.done):
                self._console.print("[yellow]the planner was restarted[/]: the goal is sent again")
                self._before, most = self._pushes, goal.max_pushes
                goal.max_pushes = most and max(1, most - self._pushes)
                handle = self.send(goal)
                ended = handle.get_result_async()
                goal.max_pushes = most
        except KeyboardInterrupt:
            self._console.print("cancelled; a push that is under way is executed to its end")
            handle.cancel_goal_async()
            self._wait(ended.done, f"the answer of the planner on {self._where}")
        result = ended.result().result
        result.pushes += self._before
        return result

    def _spin_until(self, done: Callable[[], bool]) -> bool:
        """Spin until something is done, or another planner is there; tell which."""
        from sain_core.ros.node_main import spin_until

        with self._wait.line:
            while not spin_until(self.node, done, LOOK):
                if self._present() - self._planners:
                    return done()
        return True

    def _present(self) -> set[bytes]:
        """Return what tells apart the planners that are there, and those that were killed now."""
        topic = f"{self._where}/_action/feedback"
        return {bytes(one.endpoint_gid) for one in self.node.get_publishers_info_by_topic(topic)}

    def _on_planner(self, message: str) -> bool:
        """Show what the planner waits for, or that it does not."""
        waits = message.startswith(WAITS)
        self._wait.line.say(f"the planner {message}" if waits else "")
        return waits

    def _tell(self, message: Any) -> None:
        told = message.feedback
        self._pushes = self._before + told.pushes
        place = f"{1e3 * told.goal_distance:.0f} mm"
        turn = f", {math.degrees(told.goal_turn):.0f}°" if told.goal_turn else ""
        self._console.print(f"push {self._pushes} from {place}{turn} to the goal", highlight=False)


def goal_message(options: GoalOptions) -> "Goal":
    """Return the goal that the options ask for."""
    from sain_interfaces.msg import Goal, GoalPose

    x, y = options.place
    pose = GoalPose(body=options.body, x=x, y=y, tolerance=options.tolerance)
    pose.has_heading = options.heading is not None
    pose.heading = options.heading or 0.0
    return Goal(poses=[pose], max_pushes=options.max_pushes)


def run(options: GoalOptions, console: Console) -> int:
    """Send the goal, follow it to its end, and return the exit code."""
    from sain_core.ros.node_main import command_node
    from sain_interfaces.msg import Plan

    endings = {Plan.EXHAUSTED: "all pushes were sent", Plan.NO_PUSH: "no push is left to try"}
    with command_node("goal") as node:
        sender = GoalSender(node, options.timeout, console)
        result = sender.reach(goal_message(options))
    count = f"{result.pushes} push{'' if result.pushes == 1 else 'es'}"
    where = f"{1e3 * result.goal_distance:.1f} mm"
    if result.status == Plan.REACHED:
        console.print(f"[green]reached[/] with {count}, {where} from the goal", highlight=False)
        return 0
    why = result.error_message or endings.get(result.status, "the planner gave up")
    after = f"; {count}, {where} away" if result.pushes else ""
    console.print(f"[red]not reached[/]: {escape(why)}{after}", highlight=False, soft_wrap=True)
    code = int(result.error_code)
    return NOT_REACHED if code in (0, int(ErrorCode.OK)) else code
