"""The driver of a robot arm under ros2_control: takes pushes, and answers each with its result."""

from dataclasses import replace
from time import monotonic
from typing import Any

from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from sain_arm.planning import push_events as events
from sain_arm.planning.arm_config import ArmConfig
from sain_arm.planning.push_events import ArmState, Ended, Ending, Phase
from sain_arm.planning.push_execution import PushExecution
from sain_arm.planning.push_planner import PushPlan, PushPlanner
from sain_arm.planning.timing import Trajectory
from sain_arm.robot.robot import read_robot
from sain_arm.ros.enabling import EnableListener
from sain_arm.ros.ghost import Ghost
from sain_arm.ros.joint_listener import JointListener
from sain_arm.ros.pushing_node import LOOK, PushingNode, Wanted
from sain_arm.ros.trajectory_client import TrajectoryClient
from sain_core import wire
from sain_core.errors import BusyError, SainError
from sain_core.feasibility import Stroke
from sain_core.guarding.ros.reception import take_waiting
from sain_core.push import LENGTH
from sain_core.ros.node_main import ERROR, OK, WARN, Diagnostics, steady_timer
from sain_core.ros.parameters import read_parameters
from sain_core.ros.push_driver import PushDriver
from sain_core.ros.qos import RELIABLE
from sain_core.scene import RADIUS
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray, Scene
from sain_interfaces.msg import Plan, Push


class ArmNode(PushingNode):
    """Moves the arm, one push at a time."""

    def __init__(self, **options: Any) -> None:
        """Read the robot, find out where it reaches, and wait for pushes."""
        super().__init__("arm_node", "planning", **options)
        self.config = config = read_parameters(self, ArmConfig)
        self.robot = robot = read_robot(config.robot)
        limits = replace(config.feasibility.limits, tool_radius=robot.tool_radius)
        feasibility = replace(config.feasibility, limits=limits)
        self.execution = PushExecution(config.motion, limits.clearance, config.dry_run)
        self.driver = PushDriver(self, self.begin, feasibility, config.scene_timeout)
        self.client = TrajectoryClient(self, robot, config.patience)
        self.joints = JointListener(robot, config.joints_timeout)
        self.enable = EnableListener(self, config.enable_timeout)
        self.ghost = Ghost(self)
        self._planner = PushPlanner(robot, config=config.motion)
        listen = self.driver.reception.listen
        self._inputs = [
            listen(JointState, "/joint_states", self.joints.listen, RELIABLE),
            listen(Bool, "enable", self._on_enable, RELIABLE),
        ]
        # expected after the push that is under way, and the bodies of that
        self._next: tuple[PushArray, Bodies] | None = None
        if config.motion.ahead:
            listen(Plan, "plan", self._on_plan, RELIABLE)
        figures = self.driver.reception
        self.diagnostics = Diagnostics(self, "arm", more=lambda: figures.figures)
        steady_timer(self, LOOK, self._report)
        self.find_reach(self._planner)
        self.ready = f"{robot.name} with {len(robot.joints)} joints, by {self.client.name}"

    def arm_state(self) -> ArmState:
        """Return the state of the arm now, by all that has come."""
        for subscription in self._inputs:
            take_waiting(subscription)
        joints, tip, unknown = None, None, ""
        try:
            joints = self.joints.current
        except BusyError as error:
            unknown = str(error)
        if joints is not None and self.phase is Phase.STOPS and not self.worker.pending:
            tip = self._planner.arm.tip(joints)
        return ArmState(
            time=monotonic(),
            clock=self.driver.now(),
            joints=joints,
            tip=tip,
            stamp=self.joints.stamp,
            changed=self.joints.changed,
            still=self.joints.still,
            unknown=unknown,
            disabled=self.enable.disabled,
            missing=self.client.missing,
            hidden=self._hidden,
            expects=self._expected() if self.phase is Phase.RESTS else None,
        )

    @property
    def _hidden(self) -> float:
        """For how long [s] the arm has rested after a stroke, and no scene at rest has come."""
        return max(min(monotonic() - self.joints.changed, self.driver.unseen), 0.0)

    def _on_plan(self, message: Plan) -> None:
        """Take note of the push that is expected after the one that is under way."""
        pushes = wire.decode_plan(message)[0]
        own = self.driver.busy and message.push_id == self.driver.push_id
        if own and len(pushes) > 1 and pushes[1, LENGTH] > 0.0:
            bodies = self.driver.before[1]
            self._next = self.driver.feasibility.limits.check(pushes[1], bodies), bodies

    def _expected(self) -> tuple[Stroke, Scene] | None:
        """Return the stroke that is expected next, and the bodies (N, 8) after the latest one."""
        scene, limits = self.driver.seen_after, self.driver.feasibility.limits
        if self._next is None or scene is None or len(scene) != len(self._next[1]):
            return None
        push, bodies = self._next
        return Stroke.of_push(scene, push, limits, bodies), scene

    def begin(self, push: Push, stroke: Stroke) -> None:
        """Take a push with its stroke; what it raises refuses the push."""
        self._next = None
        super().begin(push, stroke)

    def _on_enable(self, message: Bool) -> None:
        self.enable.listen(message)
        if not message.data:
            self.update(events.TimePassed())  # a goal under way is cancelled at once

    def plan(self, wanted: Wanted) -> PushPlan | Trajectory:
        """Plan a push among the bodies of its episode, and show it; or a way without one."""
        if isinstance(wanted, events.PlanRetreat):
            return self._planner.retreat(wanted.joints)
        if isinstance(wanted, events.PlanHome):
            assert self.driver.scene is not None
            return self._planner.home(self.driver.scene, wanted.joints, wanted.turn)
        if isinstance(wanted, events.PlanAhead):
            return self._planner.ahead(wanted.stroke, wanted.scene, wanted.joints)
        scene, bodies = self.driver.before
        self._planner = self._planner.among(bodies, tuple(scene[:, RADIUS].tolist()))
        plan = self._planner.plan(wanted.stroke, scene, wanted.joints)
        self.ghost.show(self._planner.arm, plan)
        return plan

    def send(self, goal: events.Send) -> None:
        """Send a goal; one that leads to a body only where the bodies are seen where they were."""
        try:
            if goal.touches:
                self.driver.check_stroke()
        except SainError as error:
            self.update(events.SendRefused(error))
            return
        if stopped := self.arm_state().stopped:  # by what came since the event
            self.update(events.GoalEnded(Ending(Ended.REJECTED, stopped)))
            return
        self.client.send(goal.trajectory, lambda ending: self.update(events.GoalEnded(ending)))

    def cancel(self, why: str) -> None:
        """Have the controller stop."""
        self.client.cancel(why)

    def _report(self) -> None:
        problem = self.driver.reception.trouble or self.client.missing
        if not self.config.dry_run:
            frozen = self.execution.frozen(self.joints.changed)
            problem = problem or frozen or self.enable.disabled
        if conflict := self.driver.conflict:
            self.diagnostics.set(ERROR, conflict, **self.driver.counts)
        else:
            level = WARN if problem else OK
            self.diagnostics.set(level, problem or self.phase, **self.driver.counts)

    def destroy_node(self) -> None:
        """Stop the arm."""
        self.client.cancel()
        self.worker.close()
        super().destroy_node()
        self.driver.release_namespace()
