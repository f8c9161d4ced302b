"""The driver of a robot arm under ros2_control: takes pushes, and answers each with its result.

What is done when is decided by `PushExecution`. This node tells it what comes, and does what it
says: plans on a thread of its own, goals to the controller, answers by `PushDriver`.
"""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from time import monotonic
from typing import Any, Final, TypeVar

from nav_msgs.msg import OccupancyGrid
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from sain_arm.planning import push_events as events
from sain_arm.planning.arm_config import ArmConfig
from sain_arm.planning.push_events import Action, ArmState, Ended, Ending, Event, Phase
from sain_arm.planning.push_execution import PushExecution
from sain_arm.planning.push_planner import PushPlan, PushPlanner
from sain_arm.planning.reach import table_of_reach
from sain_arm.robot.robot import Vector, read_robot
from sain_arm.ros.enabling import Enabled, EnableGate, Signal
from sain_arm.ros.ghost import Ghost
from sain_arm.ros.joint_listener import JointListener
from sain_arm.ros.trajectory_client import TrajectoryClient
from sain_core.errors import BusyError, SainError
from sain_core.feasibility import ReachTable
from sain_core.guarding.ros.ownership import publishers
from sain_core.guarding.ros.reception import take_waiting
from sain_core.ros import codec
from sain_core.ros.node_main import (
    ERROR,
    NAMESPACE,
    OK,
    WARN,
    Diagnostics,
    steady_timer,
)
from sain_core.ros.parameters import read_parameters
from sain_core.ros.push_driver import PushDriver, PushOrder
from sain_core.ros.qos import LATCHED, RELIABLE
from sain_core.ros.worker import Worker
from sain_core.scene import RADIUS
from sain_core.shapes.bodies import Bodies

LOOK: Final = 0.02  # [s] between looks at the enable signal

Planned = TypeVar("Planned")


class ArmNode(Node):
    """Moves the arm, one push at a time."""

    def __init__(self, **options: Any) -> None:
        """Read the robot, find out where it reaches, and wait for pushes."""
        super().__init__("arm_node", namespace=NAMESPACE, **options)
        self.config = config = read_parameters(self, ArmConfig)
        self.robot = robot = read_robot(config.robot)
        limits = replace(config.feasibility.limits, tool_radius=robot.tool_radius)
        feasibility = replace(config.feasibility, limits=limits)
        self.execution = PushExecution(config.motion, limits.clearance, config.dry_run)
        self._events = deque[Event]()
        self._is_updating = False
        self.driver = PushDriver(self, self._begin, feasibility, config.scene_timeout)
        self.client = TrajectoryClient(self, robot, config.patience)
        self.joints = JointListener(robot, config.joints_timeout)
        self.enable = EnableGate(config.enable_timeout)
        self.worker = Worker(self, "planning")
        self.ghost = Ghost(self)
        self._order: PushOrder | None = None  # the latest
        self._disputers = list[str]()  # nodes that publish the enable signal, and disagree
        self._planner: PushPlanner | None = None
        self._planned_for: tuple[Bodies, tuple[float, ...]] | None = None
        self.reach_publisher = self.create_publisher(OccupancyGrid, "reach_table", LATCHED)
        listen = self.driver.reception.listen
        self._inputs = [
            listen(JointState, "/joint_states", self.joints.listen, RELIABLE),
            listen(Bool, "enable", self._on_enable, RELIABLE),
        ]
        figures = self.driver.reception
        self.diagnostics = Diagnostics(self, "arm", more=lambda: figures.figures)
        steady_timer(self, LOOK, self._look)
        self.worker.submit(self._find_reach, self._take_reach)
        self.ready = f"{robot.name} with {len(robot.joints)} joints, by {self.client.name}"

    @property
    def phase(self) -> Phase:
        """What the arm does."""
        return self.execution.phase

    # --- events ---------------------------------------------------------------------------------

    def _begin(self, order: PushOrder) -> None:
        """Take a push; what it raises refuses the push."""
        self._order = order
        self.update(events.PushOrdered(order.stroke))

    def update(self, event: Event) -> None:
        """Take an event, and do what follows; one that comes meanwhile is taken after it."""
        self._events.append(event)
        if self._is_updating:
            return
        self._is_updating = True
        try:
            while self._events:
                next_event = self._events.popleft()
                for action in self.execution.update(next_event, self.arm_state()):
                    self._do(action)
        finally:
            self._is_updating = False

    def arm_state(self) -> ArmState:
        """Return the state of the arm now, by all that has come."""
        for subscription in self._inputs:
            take_waiting(subscription)
        joints, tip, unknown = None, None, ""
        try:
            joints = self.joints.current
        except BusyError as error:
            unknown = str(error)
        if joints is not None and self._planner is not None and self.phase is Phase.STOPS:
            tip = self._planner.arm.tip(joints)
        return ArmState(
            time=monotonic(),
            clock=self._now(),
            joints=joints,
            tip=tip,
            stamp=self.joints.stamp,
            changed=self.joints.changed,
            still=self.joints.still,
            unknown=unknown,
            disabled=self._disabled(),
            missing=self.client.missing,
            hidden=0.0 if self.driver.scene is None else self.driver.waited,
        )

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds * 1e-9)

    def _disabled(self) -> str:
        """Return why the arm is not enabled; empty: it is."""
        now, topic = monotonic(), self.resolve_topic_name("enable")
        state = self.enable.state(now)
        if state is Enabled.YES:
            return ""
        if self._disputers and self.enable.is_disputed(now):
            return (
                f"the arm is not enabled: {' and '.join(self._disputers)} disagree on {topic};"
                " all must publish true"
            )
        return f"the arm is not enabled: {state.value} on {topic}"

    def _on_enable(self, message: Bool) -> None:
        topic, now = self.resolve_topic_name("enable"), monotonic()
        count = self.count_publishers(topic)
        self.enable.update(Signal(message.data, now, count))
        if message.data:
            return
        if self.enable.is_disputed(now) and len(self._disputers) != count:
            self._disputers = publishers(self, topic)
            self.get_logger().warning(self._disabled())
        self.update(events.TimePassed())  # a goal under way is cancelled at once

    # --- actions --------------------------------------------------------------------------------

    def _do(self, action: Action) -> None:
        match action:
            case events.PlanPush(joints):
                order = self._order
                assert order is not None
                self._submit(lambda: self._plan(order, joints), events.PushPlanned)
            case events.PlanHome(joints, turn):
                planner, scene = self._planner, self.driver.scene
                assert planner is not None and scene is not None
                self._submit(lambda: planner.home(scene, joints, turn), events.WayPlanned)
            case events.PlanRetreat(joints):
                self.update(events.WayPlanned(self._retreat(joints)))
            case events.ShowPlan(plan):
                assert self._planner is not None
                self.ghost.show(self._planner.arm, plan)
            case events.Send():
                self._send(action)
            case events.Cancel(why):
                self.client.cancel(why)
            case events.Executed(doubt):
                self.driver.finish(self._now(), doubt)
            case events.Refused(error):
                self.driver.refuse(error)
            case events.Say(text, is_error):
                log = self.get_logger()
                log.error(text) if is_error else log.warning(text)

    def _submit(
        self, work: Callable[[], Planned], event: Callable[[Planned | BaseException], Event]
    ) -> None:
        """Plan on the worker's thread; the event brings the plan, or why there is none."""

        def take(done: "Future[Planned]") -> None:
            error = done.exception()
            if error is not None:
                self.driver.reception.log_defect(error)
            self.update(event(done.result() if error is None else error))

        self.worker.submit(work, take)

    def _plan(self, order: PushOrder, joints: Vector) -> PushPlan:
        """Plan on the worker's thread."""
        radii = tuple(order.scene[:, RADIUS].tolist())
        if self._planner is None or self._planned_for != (order.bodies, radii):
            self._planner = PushPlanner(self.robot, order.bodies, radii, self.config.motion)
            self._planned_for = order.bodies, radii
        return self._planner.plan(order.stroke, order.scene, joints)

    def _retreat(self, joints: Vector) -> Any:
        """Return the way straight up from joints (J,), or why there is none."""
        assert self._planner is not None
        try:
            return self._planner.retreat(joints)
        except SainError as error:
            return error

    def _send(self, action: events.Send) -> None:
        """Send a goal; one that leads to a body only where the bodies are seen where they were."""
        try:
            if action.touches:
                self.driver.check_stroke()
        except SainError as error:
            self.update(events.SendRefused(error))
            return
        if stopped := self.arm_state().stopped:  # by what came since the event
            self.update(events.GoalEnded(Ending(Ended.REJECTED, stopped)))
            return
        self.client.send(action.trajectory, lambda ending: self.update(events.GoalEnded(ending)))

    # --- looking after it -----------------------------------------------------------------------

    def _look(self) -> None:
        self.update(events.TimePassed())
        self._report()

    def _report(self) -> None:
        problem = self.driver.reception.trouble or self.client.missing
        if not self.config.dry_run:
            problem = problem or self.execution.frozen(self.joints.changed) or self._disabled()
        if conflict := self.driver.conflict:
            self.diagnostics.set(ERROR, conflict, **self.driver.counts)
        else:
            level = WARN if problem else OK
            self.diagnostics.set(level, problem or self.phase, **self.driver.counts)

    def _find_reach(self) -> ReachTable:
        return table_of_reach(PushPlanner(self.robot, config=self.config.motion))

    def _take_reach(self, done: "Future[ReachTable]") -> None:
        reach = done.result()  # what is wrong with the robot's file ends the node
        self.driver.feasibility = replace(self.driver.feasibility, reach=reach)
        self.reach_publisher.publish(codec.encode_reach(reach, self.get_clock().now().to_msg()))
        self.update(events.ReachFound())
        self.get_logger().info(f"{self.robot.name} reaches {reach.describe()}")

    def destroy_node(self) -> None:
        """Stop the arm."""
        self.client.cancel()
        self.worker.close()
        super().destroy_node()
        self.driver.release_namespace()
