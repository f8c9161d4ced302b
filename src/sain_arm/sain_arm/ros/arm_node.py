"""The driver of a robot arm under ros2_control: takes pushes, and answers each with its result.

A push is planned and checked as a whole, on a thread of its own. Then two goals are sent. The
approach touches nothing. Before the stroke the bodies must be where they were. If the stroke is
aborted, bodies may have moved: the arm retreats, and the push counts as executed, unless tool and
bodies are seen where they were. Without the enable signal or the joints' states a goal is
cancelled, and nothing more is sent.
"""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
from enum import StrEnum
from functools import partial
from time import monotonic
from typing import Any, Final

import numpy as np
from nav_msgs.msg import OccupancyGrid
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from sain_arm.planning.arm_config import ArmConfig
from sain_arm.planning.push_planner import ASIDE, PushPlan, PushPlanner
from sain_arm.planning.reach import table_of_reach
from sain_arm.planning.timing import Trajectory
from sain_arm.robot.robot import Vector, read_robot
from sain_arm.ros.enabling import Enabled, EnableGate, Signal
from sain_arm.ros.ghost import Ghost
from sain_arm.ros.joint_listener import JointListener
from sain_arm.ros.trajectory_client import Ended, Ending, TrajectoryClient
from sain_core.errors import BusyError, CancelledError, SainError
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
    LatchedTopic,
    steady_timer,
)
from sain_core.ros.parameters import read_parameters
from sain_core.ros.push_driver import PushDriver, PushOrder
from sain_core.ros.qos import RELIABLE
from sain_core.ros.worker import Worker
from sain_core.scene import RADIUS, unit
from sain_core.shapes.bodies import Bodies

LOOK: Final = 0.02  # [s] between looks at the enable signal
WAIT: Final = 1.0  # [s] for the enable signal, the controller or the arm, before a push is refused
FINDING: Final = 40.0  # [s] for the table of reach; a planner waits for 60
ARRIVED: Final = 0.02  # [rad], of a joint from the end of its goal
HIDES: Final = 1.5  # [s] after a stroke without a scene at rest: the arm may hide a body
LAG: Final = 0.3  # [s] by which joints, and states of them, may be behind a goal


class Phase(StrEnum):
    """What the arm does."""

    STARTS = "finds out where it reaches"
    RESTS = "rests"
    WAITS = "waits"
    PLANS = "plans"
    APPROACHES = "approaches"
    PUSHES = "pushes"
    STOPS = "stops"
    RETREATS = "retreats"
    GOES_HOME = "goes home"


class ArmNode(Node):
    """Moves the arm, one push at a time."""

    def __init__(self, **options: Any) -> None:
        """Read the robot, find out where it reaches, and wait for pushes."""
        super().__init__("arm_node", namespace=NAMESPACE, **options)
        self.config = config = read_parameters(self, ArmConfig)
        self.robot = robot = read_robot(config.robot)
        limits = replace(config.feasibility.limits, tool_radius=robot.tool_radius)
        feasibility = replace(config.feasibility, limits=limits)
        self.driver = PushDriver(self, self._begin, feasibility, config.scene_timeout)
        self.client = TrajectoryClient(self, robot, config.patience)
        self.joints = JointListener(robot, config.joints_timeout)
        self.enable = EnableGate(config.enable_timeout)
        self.worker = Worker(self, "planning")
        self.ghost = Ghost(self)
        self.phase = Phase.STARTS
        self._has_reach = False
        self._order: PushOrder | None = None
        self._arriving: tuple[Vector, Callable[[Ending], None], float] | None = None
        self._asked = 0.0  # when the push came, or the stroke ended [s], of a steady clock
        self._broken_off = Ending(Ended.LOST), 0.0  # how a stroke ended too early, and when [s]
        self._doubt: CancelledError | None = None  # that the stroke has moved a body
        self._froze = -np.inf  # when joints' states lagged behind a goal [s], of a steady clock
        self._disputers = list[str]()  # nodes that publish the enable signal, and disagree
        self._turns = list[float]()  # at home, that are left to try where the arm hides a body
        self._planner: PushPlanner | None = None
        self._planned_for: tuple[Bodies, tuple[float, ...]] | None = None
        self.reach_publisher = LatchedTopic(self, OccupancyGrid, "reach_table")
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

    # --- from a push to its plan ----------------------------------------------------------------

    def _begin(self, order: PushOrder) -> None:
        """Take a push; it waits a little for what it needs, so that nobody asks without end."""
        self._order, self._asked, self._doubt = order, monotonic(), None
        self._turns = []
        self.phase = Phase.WAITS
        self._try()

    def _try(self) -> None:
        """Plan the push that waits, once all is there; refuse it if that does not come."""
        order = self._order
        if order is None or self.phase != Phase.WAITS:
            return
        try:
            joints = self._ready()
        except BusyError as error:
            if monotonic() > self._asked + (WAIT if self._has_reach else FINDING):
                self._give_up(error)
            return
        self.phase = Phase.PLANS
        self.worker.submit(lambda: self._plan(order, joints), self._take_plan)

    def _ready(self) -> Vector:
        """Return where the arm rests, or raise `BusyError` for what is missing."""
        if not self._has_reach:
            raise BusyError("the arm's reach is being found out")
        joints = self.joints.current
        missing = self.client.missing or self._disabled() or self._frozen()
        if missing and not self.config.dry_run:
            raise BusyError(missing)
        if self.client.busy or not self.joints.still:
            raise BusyError("the arm still moves")
        return joints

    def _plan(self, order: PushOrder, joints: Vector) -> PushPlan:
        """Plan on the worker's thread."""
        radii = tuple(order.scene[:, RADIUS].tolist())
        if self._planner is None or self._planned_for != (order.bodies, radii):
            self._planner = PushPlanner(self.robot, order.bodies, radii, self.config.motion)
            self._planned_for = order.bodies, radii
        return self._planner.plan(order.stroke, order.scene, joints)

    def _take_plan(self, done: "Future[PushPlan]") -> None:
        error, order = done.exception(), self._order
        if error is not None:
            self.driver.reception.log_defect(error)
            self._give_up(error)
            return
        assert order is not None
        plan = done.result()
        assert self._planner is not None
        self.ghost.show(self._planner.arm, plan)
        if self.config.dry_run:
            self._give_up(CancelledError("a dry run: the way is possible; nothing was moved"))
        elif order.stroke.length == 0.0:
            self._conclude()
        else:
            self.phase = Phase.APPROACHES
            self._send(plan.approach, partial(self._on_approached, plan), touches=True)

    # --- motion ---------------------------------------------------------------------------------

    def _send(
        self, trajectory: Trajectory, then: Callable[[Ending], None], touches: bool = False
    ) -> None:
        """Send a goal, if the arm may move; `then` is called when the arm is where that ends.

        One that `touches` leads to a body: all bodies must be seen where they were.
        """
        if stopped := self._stopped():
            then(Ending(Ended.REJECTED, stopped))
            return
        try:
            if touches:
                self.driver.check_stroke()
        except SainError as error:
            self._give_up(error)
            return
        self.client.send(trajectory, partial(self._on_ended, trajectory, monotonic(), then))

    def _on_ended(
        self, trajectory: Trajectory, sent: float, then: Callable[[Ending], None], ending: Ending
    ) -> None:
        if ending.how is not Ended.REJECTED:
            self._note_frozen(trajectory, sent)
        if ending.how is Ended.SUCCEEDED:
            self._arriving = trajectory.positions[-1], then, monotonic() + WAIT
            self._try_arriving()
        else:
            then(ending)

    def _note_frozen(self, trajectory: Trajectory, sent: float) -> None:
        """Take note of joints' states that do not follow a goal, which was sent at a time [s]."""
        now = monotonic()
        seen, meant = max(self.joints.changed - sent, 0.0), max(now - sent - LAG, 0.0)
        if seen < meant:
            off = np.abs(trajectory.at(meant)[0] - trajectory.at(seen)[0]).max()
            self._froze = now if off > ARRIVED else self._froze

    def _frozen(self) -> str:
        """Return in words that the joints' states did not follow a goal; empty: they do."""
        if self.joints.changed >= self._froze:
            return ""
        return (
            "/joint_states did not follow the arm's last goal, and have not changed since: the"
            " arm's place is unknown; check who publishes them, then start arm_node anew"
        )

    def _stopped(self) -> str:
        """Return why the arm may not move now, by all that has come; empty: it may."""
        for subscription in self._inputs:
            take_waiting(subscription)
        try:
            len(self.joints.current)
        except BusyError as error:
            return str(error)
        return self._disabled()

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
        self.client.cancel(self._disabled())

    def _try_arriving(self) -> None:
        """Believe that a goal has succeeded once the joints say so, too."""
        if self._arriving is None:
            return
        end, then, latest = self._arriving
        try:
            off = float(np.abs(self.joints.current - end).max())
        except BusyError:
            off = np.inf
        if off <= ARRIVED:
            self._arriving = None
            then(Ending(Ended.SUCCEEDED))
        elif monotonic() > latest:
            self._arriving = None
            text = f"called successful, but a joint is {off:.3f} rad from its end"
            then(Ending(Ended.ABORTED, text))

    def _on_approached(self, plan: PushPlan, ending: Ending) -> None:
        order = self._order
        assert order is not None
        if ending.how is not Ended.SUCCEEDED:
            self._give_up(CancelledError(f"{ending}; the tool had not come to the body yet"))
            return
        self.phase = Phase.PUSHES
        self._send(plan.stroke, self._on_stroked, touches=True)

    def _on_stroked(self, ending: Ending) -> None:
        if ending.how is Ended.SUCCEEDED:
            self._conclude()
            self._turns = list(ASIDE)
        elif ending.how is Ended.REJECTED:
            self._give_up(_untouched(ending))
        else:
            self.phase, self._asked = Phase.STOPS, monotonic()
            self._broken_off = ending, self._now()

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds * 1e-9)

    def _seems_untouched(self) -> bool:
        """Tell whether the joints' states have the tool nearer to its start than the body was.

        A state of the joints from before the end of the goal does not tell.
        """
        order, (_, since) = self._order, self._broken_off
        if order is None or self._planner is None or self.joints.stamp < since:
            return False
        try:
            tip = self._planner.arm.tip(self.joints.current)
        except BusyError:
            return False
        way = (tip[:2] - order.stroke.start) @ unit(np.asarray(order.stroke.heading))
        low = tip[2] < self.config.motion.raised - 1e-3
        return bool(low and way < 0.5 * self.driver.feasibility.limits.clearance)

    def _try_retreat(self) -> None:
        """Lift the tool once the arm rests; without the enable signal it stays where it is."""
        if self.phase != Phase.STOPS or self.client.busy:
            return
        late = monotonic() > self._asked + WAIT
        ending, since = self._broken_off
        if not late and not (self.joints.still and self.joints.stamp >= since):
            return
        if self._seems_untouched():
            self._doubt = _untouched(ending)
        self.get_logger().warning(f"{ending}; bodies may have moved")
        try:
            if frozen := self._frozen():
                raise BusyError(frozen)
            assert self._planner is not None
            way = self._planner.retreat(self.joints.current)
        except SainError as error:
            self.get_logger().error(f"no retreat: {error}")
            self._conclude()
            return
        self.phase = Phase.RETREATS
        self._send(way, self._on_retreated)

    def _on_retreated(self, ending: Ending) -> None:
        if ending.how is not Ended.SUCCEEDED:
            self.get_logger().error(f"no retreat: {ending}")
        self._conclude()

    def _try_home(self) -> None:
        """Go home above the bodies where none comes to rest: the arm may hide one."""
        scene, planner = self.driver.scene, self._planner
        tried = len(ASIDE) - len(self._turns)
        if not self._turns or self.phase != Phase.RESTS or self.driver.waited < HIDES * (tried + 1):
            return
        if scene is None or planner is None or self.client.busy or not self.joints.still:
            return
        if self._stopped() or self._frozen():
            return
        joints, turn = self.joints.current, self._turns.pop(0)
        self.phase = Phase.GOES_HOME
        self.worker.submit(lambda: planner.home(scene, joints, turn), self._go_home)

    def _go_home(self, done: "Future[Trajectory]") -> None:
        if self.phase != Phase.GOES_HOME:
            return
        if (error := done.exception()) is not None:
            self.driver.reception.log_defect(error)
            self.get_logger().warning(f"a body may be hidden by the arm, which stays: {error}")
            self.phase = Phase.RESTS
            return
        self._send(done.result(), self._on_home)

    def _on_home(self, ending: Ending) -> None:
        if ending.how is not Ended.SUCCEEDED:
            self.get_logger().error(f"the arm is not home: {ending}")
        if self.phase == Phase.GOES_HOME:
            self.phase = Phase.RESTS

    def _conclude(self) -> None:
        """End a push that was executed."""
        self.phase, self._order = Phase.RESTS, None
        self.driver.finish(self._now(), self._doubt)

    def _give_up(self, error: BaseException) -> None:
        """End a push by which no body was moved."""
        self.phase, self._order = Phase.RESTS, None
        self.driver.refuse(error)

    # --- looking after it -----------------------------------------------------------------------

    def _look(self) -> None:
        if why := self._stopped():
            self.client.cancel(why)
        self._try()
        self._try_arriving()
        self._try_retreat()
        self._try_home()
        self._report()

    def _report(self) -> None:
        problem = self.driver.reception.trouble or self.client.missing
        if not self.config.dry_run:
            problem = problem or self._frozen() or self._disabled()
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
        self._has_reach = True
        if self._order is None:  # a push may wait for it
            self.phase = Phase.RESTS
        self.get_logger().info(f"{self.robot.name} reaches {reach.describe()}")

    def destroy_node(self) -> None:
        """Stop the arm."""
        self.client.cancel()
        self.worker.close()
        super().destroy_node()
        self.driver.release_namespace()


def _untouched(ending: Ending) -> CancelledError:
    return CancelledError(f"{ending}; the tool had not touched the body yet")
