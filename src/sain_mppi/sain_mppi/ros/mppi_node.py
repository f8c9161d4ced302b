"""The planner: for each settled scene on the way to a goal, one push."""

from concurrent.futures import Future
from functools import partial
from itertools import count
from typing import Any

from rclpy.node import Node
from visualization_msgs.msg import MarkerArray

from sain_core import wire
from sain_core.dynamics import as_rollout
from sain_core.errors import ErrorCode, SainError
from sain_core.plugins import as_observed, load_dynamics
from sain_core.ros import codec
from sain_core.ros.diagnostics import OK, WARN, Diagnostics
from sain_core.ros.node_main import NAMESPACE
from sain_core.ros.parameters import read_parameters
from sain_core.ros.qos import LATCHED, RELIABLE
from sain_core.ros.steady import steady_timer
from sain_core.ros.worker import Worker
from sain_core.scene import is_settled
from sain_core.shapes.bodies import Bodies as CoreBodies
from sain_core.shapes.received import check_unchanged, decode_bodies
from sain_interfaces.msg import Bodies, Goal, Plan, Push, PushResult
from sain_interfaces.msg import Scene as SceneMessage
from sain_mppi.loop.agent import SERVICE, MppiConfig, planning_agent
from sain_mppi.loop.decision import PlanJob, PushDecision, Stop, StopReason
from sain_mppi.ros.goal_message import decode_task
from sain_mppi.ros.goals import Goals
from sain_mppi.ros.markers import plan_markers
from sain_mppi.ros.plan_message import (
    plan_of_bad_goal,
    plan_of_decision,
    plan_of_stop,
    push_message,
    summary,
)
from sain_mppi.ros.remote import RemoteRollout

MOST_EARLY = 500  # scenes that are kept until their shapes are known
LOOK_AGAIN = 0.1  # [s] between looks for what no message tells of


class MppiNode(Node):
    """Feeds the agent messages and publishes its decisions. Planning runs on a worker thread."""

    def __init__(self, **options: Any) -> None:
        """Get the agent ready, and wait for a scene and a goal."""
        super().__init__("mppi_node", namespace=NAMESPACE, **options)
        self.config = config = read_parameters(self, MppiConfig)
        in_process = config.dynamics != SERVICE
        self.remote = None if in_process else RemoteRollout(self, config.model_timeout)
        model = self.remote or as_rollout(
            as_observed(load_dynamics(config.model), config.estimator.unknown)
        )
        self.agent = planning_agent(model, as_rollout(load_dynamics(config.prior)), config)
        self.worker = Worker(self, "planning")
        self.plan_ids = count(1)
        self.bodies: tuple[int, CoreBodies] | None = None  # the latest, and of which episode
        self.early: list[SceneMessage] = []  # of an episode whose shapes are not known yet
        self._offer()
        self.starting = True
        self.diagnostics.set(WARN, "no model serves rollout yet: plans rest on the prior")
        steady_timer(self, LOOK_AGAIN, self._look_again)
        where = "a service" if self.remote else config.model
        self.ready = f"plans with {where}, or else with {config.prior}"

    def _offer(self) -> None:
        self.push_publisher = self.create_publisher(Push, "push", RELIABLE)
        self.plan_publisher = self.create_publisher(Plan, "plan", RELIABLE)
        self.marker_publisher = self.create_publisher(MarkerArray, "plan_markers", RELIABLE)
        self.diagnostics = Diagnostics(self)
        self.create_subscription(SceneMessage, "scene", self._on_scene, RELIABLE)
        self.create_subscription(PushResult, "push_result", self._on_result, RELIABLE)
        self.create_subscription(Bodies, "shapes", self._on_bodies, LATCHED)
        self.goals = Goals(
            self, self._on_goal, self._drop, lambda: None if self.bodies is None else self.bodies[1]
        )

    def _look_again(self) -> None:
        """Look for the model at the start, and go on where a message that was waited for fails."""
        if self.starting and (self.remote is None or self.remote.ready):
            self.starting = False
            self.diagnostics.set(OK, "ready")
        self._go_on()

    def _on_goal(self, message: Goal) -> None:
        try:
            task = decode_task(message)
        except SainError as error:
            self._publish(plan_of_bad_goal(message, error))
            return
        self._tell(self.agent.aim(task))
        self._go_on()

    def _drop(self, error: SainError) -> None:
        """Follow no goal any more; a push that is under way is executed to its end."""
        if (task := self.agent.drop()) is not None:
            self._tell(Stop(task, StopReason.FAILED, error=error))
        self._go_on()

    def _on_bodies(self, message: Bodies) -> None:
        try:
            bodies = decode_bodies(message)
            if self.bodies is not None and self.bodies[0] == message.episode_id:
                check_unchanged(self.bodies[1], bodies)
        except SainError as error:
            text = f"the shapes of episode {message.episode_id} are ignored: {error}"
            self.get_logger().error(text)
            self.diagnostics.set(WARN, text)
            return
        self.bodies = message.episode_id, bodies
        self.agent.meet(*self.bodies)
        early, self.early = self.early, []
        for scene in early:
            self._on_scene(scene)

    def _waits_for_shapes(self, episode_id: int) -> bool:
        """Tell whether a simulator sends shapes, and those of an episode have not come yet.

        Topics overtake each other. Recordings from before there were shapes have none to wait for.
        """
        known = self.bodies is not None and self.bodies[0] == episode_id
        return not known and self.count_publishers("shapes") > 0

    def _on_scene(self, message: SceneMessage) -> None:
        try:
            scene = wire.decode_disks(message.disks)
        except SainError as error:
            self.diagnostics.set(WARN, f"scene {message.scene_id} is ignored: {error}")
            return
        if self._waits_for_shapes(message.episode_id):
            same = [early for early in self.early if early.episode_id == message.episode_id]
            self.early = [*same[-MOST_EARLY:], message]
            return
        if message.settled and self.config.estimator.is_exact and not is_settled(scene):
            self.get_logger().warning(
                "scenes are called settled while their bodies move: noisy observations need"
                " estimator.noise; no goal counts as reached",
                once=True,
            )
        observed = codec.decode_time(message.header.stamp)
        self.agent.see(scene, message.episode_id, message.scene_id, message.settled, observed)
        self._go_on()

    def _on_result(self, message: PushResult) -> None:
        push_id, code = message.push_id, message.error_code
        if code == ErrorCode.OK:
            try:
                self.agent.learn(message.episode_id, *wire.decode_result(message))
            except SainError as error:
                self.get_logger().warning(f"nothing is learned of push {push_id}: {error}")
        if self.agent.answered(push_id, code, codec.decode_time(message.header.stamp)):
            self.get_logger().warning(f"push {push_id} refused: {message.error_message}")
        self._go_on()

    def _go_on(self) -> None:
        """Start on what is to be decided next, if anything."""
        step = self.agent.next()
        if isinstance(step, PlanJob):
            self.worker.submit(partial(self.agent.decide, step), self._on_decided)
        else:
            self._tell(step)

    def _on_decided(self, done: "Future[PushDecision | Stop | None]") -> None:
        decision = self.agent.conclude(done.result())
        if isinstance(decision, PushDecision):
            self._send(decision)
        else:
            self._tell(decision)
        self._go_on()

    def _send(self, decision: PushDecision) -> None:
        stamp, source = self.get_clock().now().to_msg(), self.get_fully_qualified_name()
        self.push_publisher.publish(push_message(decision, stamp, source))
        model = self.config.model if self.remote is None else self.remote.model
        model = model if decision.failure is None else self.config.prior
        plan = plan_of_decision(decision, model, self.config.planner)
        complete = partial(self.agent.complete, decision)
        self.worker.submit(complete, partial(self._on_complete, plan))
        self.worker.submit(partial(self.agent.prepare, decision), self._on_prepared)

    def _on_complete(self, plan: Plan, done: "Future[PushDecision]") -> None:
        """Publish a plan whose push is on its way, with all that is now known of it."""
        decision = done.result()
        if decision.plan is not None and decision.plan.regions is not None:
            plan.regions = codec.encode_floats(decision.plan.regions)
        self._publish(plan)
        self.marker_publisher.publish(plan_markers(decision, self.get_clock().now().to_msg()))
        self._go_on()  # noisy scenes after the push may have waited for what is known now

    def _on_prepared(self, done: "Future[None]") -> None:
        """Let an error that should not be surface."""
        done.result()

    def _tell(self, stop: Stop | None) -> None:
        if stop is not None:
            self._publish(plan_of_stop(stop))

    def _publish(self, plan: Plan) -> None:
        plan.plan_id = next(self.plan_ids)
        plan.header = codec.header(self.get_clock().now().to_msg())
        self.plan_publisher.publish(plan)
        self.goals.follow(plan, self.agent.pushes)
        self.starting = False  # what became of a plan says more
        well = plan.error_code == ErrorCode.OK
        self.diagnostics.set(OK if well else WARN, **summary(plan), pushes=self.agent.pushes)

    def destroy_node(self) -> None:
        """Stop planning."""
        self.agent.cancel()
        if self.remote is not None:
            self.remote.close()
        self.goals.close()
        self.worker.close()
        super().destroy_node()
