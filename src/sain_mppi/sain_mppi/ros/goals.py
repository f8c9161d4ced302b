"""Goals as ROS users send them: messages of any durability, poses from RViz, an action."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, cast

from geometry_msgs.msg import PoseStamped
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future

from sain_core import wire
from sain_core.errors import CancelledError, InvalidInputError, error_reply
from sain_core.guarding.ros.reception import SERVICE, Reception
from sain_core.push import push_ids
from sain_core.ros.codec import WORLD_FRAME, encode_disks, header
from sain_core.ros.qos import LATCHED, LATCHED_QUEUE, RELIABLE
from sain_core.shapes.bodies import Bodies
from sain_interfaces.action import Reach
from sain_interfaces.msg import DiskState, Goal, GoalPose, Plan
from sain_mppi.agent.events import Task

RESULTS_KEPT: Final = 60  # [s], of actions, for clients that ask late
REMEMBERED: Final = 100  # messages, so that none counts twice


@dataclass
class ActionGoal:
    """An action's goal that is being followed."""

    handle: ServerGoalHandle
    goal_id: int
    pushes: int
    ended: Future  # with the last plan, or with the error that ended it
    latest: Plan


class GoalHandlers(NamedTuple):
    """What is called with goals."""

    set_goal: Callable[[Goal], None]  # with each
    refuse: Callable[[Goal, BaseException], None]  # ... that cannot be one
    cancel: Callable[[CancelledError], None]  # when an action is cancelled


class Goals:
    """Listens for goals. Poses and actions become messages on ``goal``, so recordings have them."""

    def __init__(
        self, node: Node, reception: Reception, handlers: GoalHandlers, bodies: Callable[[], Bodies]
    ) -> None:
        self._node = node
        self._reception = reception
        self._handlers = handlers
        self._bodies = bodies
        self.seen: deque[int] = deque(maxlen=REMEMBERED)
        self._ids = push_ids()  # far from those that people count from 1
        self._publisher: Any = None  # only with a goal of our own: `goal` has one owner in a graph
        self._followed: ActionGoal | None = None
        # Latched goals are heard by who comes late; `ros2 topic pub` offers none that are latched.
        # With queues of one length, what is heard first is never older than what was heard before.
        self._hear = reception.guarded("goal", self._on_goal, handlers.refuse)
        for qos in (LATCHED_QUEUE, RELIABLE):
            node.create_subscription(Goal, "goal", cast(Any, self._on_heard), qos)
        reception.listen(PoseStamped, "goal_pose", self._on_pose, RELIABLE)
        self._server = ActionServer(
            node,
            Reach,
            "reach",
            reception.act("reach", self._reach, self._abort),
            cancel_callback=self._on_cancel,
            callback_group=ReentrantCallbackGroup(),
            result_timeout=RESULTS_KEPT,
            goal_service_qos_profile=SERVICE,
            result_service_qos_profile=SERVICE,
            cancel_service_qos_profile=SERVICE,
        )

    def follow(self, plan: Plan, pushes: int) -> None:
        """Tell the action's client of a plan that was published, and how many pushes were sent."""
        followed = self._followed
        if followed is None or plan.goal_id != followed.goal_id:
            return
        followed.latest, followed.pushes = plan, pushes
        if plan.status != Plan.PUSH:
            self._end(None)
            return
        followed.handle.publish_feedback(
            Reach.Feedback(
                pushes=pushes,
                goal_distance=plan.goal_distance,
                goal_turn=plan.goal_turn,
                predicted=predicted_disks(plan),
            )
        )

    def close(self) -> None:
        """Stop listening for actions."""
        self._server.destroy()

    def _on_heard(self, message: Goal, info: Any) -> None:
        sent = info["source_timestamp"]
        if sent not in self.seen:  # both subscriptions hear a latched goal
            self.seen.append(sent)
            self._hear(message)

    def _on_goal(self, message: Goal) -> None:
        if self._followed is not None and self._followed.goal_id != message.goal_id:
            self._end(CancelledError(f"goal {message.goal_id} was given"))
        self._handlers.set_goal(message)

    def _on_pose(self, message: PoseStamped) -> None:
        if message.header.frame_id not in ("", WORLD_FRAME):
            raise InvalidInputError(
                f"the goal pose is in frame {message.header.frame_id!r}; allowed: {WORLD_FRAME!r}"
            )
        x, y, heading = wire.decode_pose(message.pose, "the goal pose").tolist()
        body, turns = self._target()
        pose = GoalPose(body=body, x=x, y=y, heading=heading, has_heading=turns)
        self._publish(Goal(goal_id=next(self._ids), poses=[pose]))

    def _target(self) -> tuple[int, bool]:
        """The body that a single pose is for, and whether its heading can be seen."""
        bodies = self._bodies()
        body = min(1, len(bodies) - 1)
        return body, not bodies.shapes[body].is_round

    def _publish(self, goal: Goal) -> None:
        if self._publisher is None:
            self._publisher = self._node.create_publisher(Goal, "goal", LATCHED)
        goal.header = header(self._node.get_clock().now().to_msg())
        self._publisher.publish(goal)  # and is heard here, as by all others

    def _abort(self, handle: ServerGoalHandle, code: int, message: str) -> Reach.Result:
        handle.abort()
        return Reach.Result(status=Plan.NO_PUSH, error_code=code, error_message=message)

    async def _reach(self, handle: ServerGoalHandle) -> Reach.Result:
        goal = handle.request.goal
        goal.goal_id = goal.goal_id or next(self._ids)
        self._end(CancelledError(f"goal {goal.goal_id} was given"))
        followed = ActionGoal(handle, goal.goal_id, 0, Future(), Plan())
        self._followed = followed
        self._publish(goal)
        error = await followed.ended
        plan = followed.latest
        result = Reach.Result(
            status=plan.status,
            error_code=plan.error_code,
            error_message=plan.error_message,
            pushes=followed.pushes,
            goal_distance=plan.goal_distance,
            goal_turn=plan.goal_turn,
        )
        if error is not None:
            result.error_code, result.error_message = error_reply(error)
        if handle.is_cancel_requested:
            handle.canceled()
        elif plan.status == Plan.REACHED:
            handle.succeed()
        else:
            handle.abort()
        return result

    def _on_cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        followed = self._followed
        if followed is not None and followed.handle == handle:
            error = CancelledError(f"goal {followed.goal_id} was cancelled")
            self._end(error)
            self._handlers.cancel(error)  # the client has its result by then
        return CancelResponse.ACCEPT

    def _end(self, error: CancelledError | None) -> None:
        followed, self._followed = self._followed, None
        if followed is not None:
            followed.ended.set_result(error)


def task_of(message: Goal) -> Task:
    """Return the task that a message gives; raise `SainError` if its goal cannot be one."""
    ids = message.goal_id, message.episode_id
    return Task(*ids, wire.decode_goal(message), message.max_pushes)


def predicted_disks(plan: Plan) -> list[DiskState]:
    """Return where the push of a plan should lead the bodies; without a prediction, none."""
    predicted = wire.decode_plan(plan)[1]
    return encode_disks(predicted[0]) if len(predicted) else []
