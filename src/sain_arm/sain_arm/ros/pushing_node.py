"""What every robot that pushes has in common as a node: it runs one `PushExecution`.

Events go into the state machine one after another, and its actions are done: plans on a thread of
their own, answers by `PushDriver`. A robot adds where its joints are, how it plans, and who follows
its trajectories.
"""

from abc import ABC, abstractmethod
from collections import deque
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar, Final

from nav_msgs.msg import OccupancyGrid
from rclpy.node import Node

from sain_arm.planning import push_events as events
from sain_arm.planning.push_events import Action, ArmState, Event, Phase
from sain_arm.planning.push_execution import PushExecution
from sain_arm.planning.push_planner import PushPlan, PushPlanner
from sain_arm.planning.reach import reach_of
from sain_arm.planning.timing import Trajectory
from sain_core.errors import CancelledError
from sain_core.feasibility import Reach, ReachTable, Stroke
from sain_core.ros import codec
from sain_core.ros.node_main import NAMESPACE, steady_timer
from sain_core.ros.push_driver import PushDriver
from sain_core.ros.qos import LATCHED
from sain_core.ros.worker import Worker
from sain_interfaces.msg import Push

LOOK: Final = 0.02  # [s] between looks at the arm

Wanted = events.PlanPush | events.PlanRetreat | events.PlanHome | events.PlanAhead


class PushingNode(Node, ABC):
    """Carries out one push at a time. What is abstract, a robot adds."""

    awaits: ClassVar = False

    execution: PushExecution  # the state machine; a robot makes it,
    driver: PushDriver  # and this, which takes pushes and answers them

    def __init__(self, name: str, thread: str, **options: Any) -> None:
        """Make the node, and a thread with this name for what must not block the executor."""
        super().__init__(name, namespace=NAMESPACE, **options)
        self.worker = Worker(self, thread)
        self._events, self._is_updating = deque[Event](), False
        steady_timer(self, LOOK, lambda: self.update(events.TimePassed()))

    @property
    def phase(self) -> Phase:
        """What the arm does."""
        return self.execution.phase

    @abstractmethod
    def arm_state(self) -> ArmState:
        """Return the state of the arm now, by all that has come."""

    @abstractmethod
    def plan(self, wanted: Wanted) -> PushPlan | Trajectory:
        """Plan a push, or a way without one, on the worker's thread."""

    @abstractmethod
    def send(self, goal: events.Send) -> None:
        """Have a goal followed; `GoalEnded` or `SendRefused` comes once."""

    @abstractmethod
    def cancel(self, why: str) -> None:
        """Have the arm stop."""

    def answer_executed(self, doubt: CancelledError | None) -> None:
        """Answer that the push was executed; with a doubt, if a body is seen to have moved."""
        self.driver.finish(self.driver.now(), doubt)

    def begin(self, push: Push, stroke: Stroke) -> None:
        """Take a push with its stroke; what it raises refuses the push."""
        self.update(events.PushOrdered(stroke))

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

    def _do(self, action: Action) -> None:
        match action:
            case events.PlanPush() | events.PlanRetreat() | events.PlanHome() | events.PlanAhead():
                self.worker.submit(lambda: self.plan(action), partial(self._take_plan, action))
            case events.Send():
                self.send(action)
            case events.Cancel(why):
                self.cancel(why)
            case events.Executed(doubt):
                self.answer_executed(doubt)
            case events.Refused(error):
                self.driver.refuse(error)
            case events.Say(text, is_error):
                log = self.get_logger()
                log.error(text) if is_error else log.warning(text)

    def _take_plan(self, wanted: Wanted, done: "Future[Any]") -> None:
        """Go on with a plan, or why there is none."""
        if (error := done.exception()) is not None:
            self.driver.reception.log_defect(error)
        planned = events.PushPlanned if isinstance(wanted, events.PlanPush) else events.WayPlanned
        self.update(planned(done.result() if error is None else error))

    def find_reach(self, planner: PushPlanner) -> None:
        """Take pushes once it is computed where the arm reaches, or stated in its file."""
        self.worker.submit(
            lambda: reach_of(planner),
            lambda done: self.take_reach(done.result()),  # a wrong file of a robot ends the node
        )

    def take_reach(self, reach: Reach) -> None:
        """Take pushes within a reach; publish it, unless planners begin with it."""
        self.driver.feasibility = replace(self.driver.feasibility, reach=reach)
        if reach != Reach():
            table = reach if isinstance(reach, ReachTable) else reach.table
            stamp = codec.encode_time(round(1e9 * self.driver.now()))
            publisher = self.create_publisher(OccupancyGrid, "reach_table", LATCHED)
            publisher.publish(codec.encode_reach(table, stamp))
            self.get_logger().info(f"the arm reaches {reach.describe()}")
        self.update(events.ReachFound())
