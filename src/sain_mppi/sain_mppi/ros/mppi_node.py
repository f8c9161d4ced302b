"""The planner: for each settled scene on the way to a goal, one push."""

from concurrent.futures import Future
from functools import partial
from itertools import count
from time import monotonic
from typing import Any

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from visualization_msgs.msg import MarkerArray

from sain_core.dynamics import as_rollout
from sain_core.errors import CancelledError, ErrorCode, NoPushError, SainError
from sain_core.plugins import load_dynamics
from sain_core.push import push_ids
from sain_core.ros import codec
from sain_core.ros.diagnostics import OK, WARN, Diagnostics
from sain_core.ros.node_main import NAMESPACE, node_main
from sain_core.ros.parameters import read_parameters
from sain_core.ros.qos import LATCHED, RELIABLE
from sain_core.ros.worker import Worker
from sain_interfaces.msg import Goal, Plan, Push, PushResult
from sain_interfaces.msg import Scene as SceneMessage
from sain_mppi.loop.agent import Decider, Decision
from sain_mppi.loop.goal_tracker import Job, Pursuit, Task, Verdict, View
from sain_mppi.loop.memory import EpisodeMemory
from sain_mppi.loop.settings import SERVICE, MppiConfig
from sain_mppi.ros.markers import plan_markers
from sain_mppi.ros.plan_message import STATUS, plan_of_decision, plan_of_job, plan_of_task, summary
from sain_mppi.ros.remote import RemoteRollout

LOOK_AGAIN = 0.1  # [s] between looks for what no message tells of


class MppiNode(Node):
    """Plans on a worker thread. The pursuit belongs to the executor's."""

    def __init__(self, **options: Any) -> None:
        """Get model and physics ready, and wait for a scene and a goal."""
        super().__init__("mppi_node", namespace=NAMESPACE, **options)
        self.config = config = read_parameters(self, MppiConfig)
        self.remote: RemoteRollout | None = None
        if config.dynamics == SERVICE:
            self.remote = RemoteRollout(self, config.model_timeout)
        model = self.remote or as_rollout(load_dynamics(config.model))
        physics = as_rollout(load_dynamics(config.prior))
        self.decider = Decider(model, physics, config.planner, config.feasibility, config.seed)
        self.pursuit = Pursuit(config.pursuit, config.feasibility.table)
        self.worker = Worker(self, "planning")
        self.memory = EpisodeMemory()
        self.running: Job | None = None
        self.sent: dict[int, Decision] = {}
        self.push_ids, self.plan_ids = push_ids(), count(1)
        self._offer()
        self.starting = True
        self.diagnostics.set(WARN, "no model serves rollout yet: plans rest on the prior")
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may stand still
        self.create_timer(LOOK_AGAIN, self._look_again, clock=steady)
        where = "a service" if self.remote else config.model
        self.get_logger().info(f"ready: plans with {where}, or else with {config.prior}")

    def _offer(self) -> None:
        self.push_publisher = self.create_publisher(Push, "push", RELIABLE)
        self.plan_publisher = self.create_publisher(Plan, "plan", RELIABLE)
        self.marker_publisher = self.create_publisher(MarkerArray, "plan_markers", RELIABLE)
        self.diagnostics = Diagnostics(self)
        self.create_subscription(SceneMessage, "scene", self._on_scene, RELIABLE)
        self.create_subscription(PushResult, "push_result", self._on_result, RELIABLE)
        self.create_subscription(Goal, "goal", self._on_goal, LATCHED)

    def _look_again(self) -> None:
        """Look for the model at the start, and go on where a message that was waited for fails."""
        if self.starting and (self.remote is None or self.remote.ready):
            self.starting = False
            self.diagnostics.set(OK, "ready")
        self._go_on()

    def _on_goal(self, message: Goal) -> None:
        place = np.array([message.x, message.y])
        task = Task(
            message.goal_id, message.episode_id, place, message.tolerance, message.max_pushes
        )
        try:
            self.pursuit.aim(task)
        except SainError as error:
            self._publish(plan_of_task(task, Plan.NO_PUSH, error))
        self._go_on()

    def _on_scene(self, message: SceneMessage) -> None:
        try:
            scene = codec.decode_disks(message.disks)
        except SainError as error:
            self.diagnostics.set(WARN, f"scene {message.scene_id} is ignored: {error}")
            return
        ids = (message.episode_id, message.scene_id)
        self.pursuit.see(View(scene, *ids, message.settled, monotonic()))
        self._go_on()

    def _on_result(self, message: PushResult) -> None:
        if message.error_code == ErrorCode.OK:
            self._remember(message)
        again = self.pursuit.answered(message.push_id, message.error_code)
        decision = self.sent.pop(message.push_id, None)
        if decision is None or message.error_code == ErrorCode.OK:
            self._go_on()
            return
        self.get_logger().warning(f"push {message.push_id} refused: {message.error_message}")
        self.worker.submit(lambda: self.decider.refused(decision, again), Future.result)
        self._go_on()

    def _remember(self, message: PushResult) -> None:
        """Learn from a push that was executed, whoever sent it."""
        try:
            self.memory.add(message.episode_id, *codec.decode_result(message))
        except SainError as error:
            self.get_logger().warning(f"nothing is learned of push {message.push_id}: {error}")

    def _go_on(self) -> None:
        """Start on what is to be decided next; end what is no longer wanted."""
        if self.running is not None:
            if not self.pursuit.wants(self.running):
                self.decider.cancel()
            return
        job = self.pursuit.next_job()
        if job is None:
            return
        verdict = self.pursuit.verdict(job)
        if verdict is Verdict.PLAN:
            self.running = job
            self.decider.begin()
            past = self.memory.of(job.view.episode_id, len(job.view.scene))
            self.worker.submit(lambda: self.decider.decide(job, past), self._on_decided)
        elif verdict is Verdict.GIVE_UP:
            error = NoPushError(f"{job.attempt} pushes in a row were refused from this scene")
            self._publish(plan_of_job(job, Plan.NO_PUSH, error))
        else:
            self._publish(plan_of_job(job, STATUS[verdict]))

    def _on_decided(self, done: "Future[Decision]") -> None:
        job, self.running = self.running, None
        assert job is not None
        try:
            decision = done.result()
            if self.pursuit.wants(job):
                self._send(decision)
        except CancelledError:
            self.get_logger().debug("a plan was cancelled: its goal or scene is past")
        except SainError as error:
            self._publish(plan_of_job(job, Plan.NO_PUSH, error))
        self._go_on()

    def _send(self, decision: Decision) -> None:
        push_id, (episode_id, scene_id) = next(self.push_ids), decision.job.view.key
        self.push_publisher.publish(
            codec.encode_push(
                decision.result.push,
                stamp=self.get_clock().now().to_msg(),
                push_id=push_id,
                episode_id=episode_id,
                scene_id=scene_id,
                source=self.get_fully_qualified_name(),
            )
        )
        self.pursuit.sent(push_id)
        self.sent[push_id] = decision
        model = self._model(decision)
        plan = plan_of_decision(decision, push_id, model, self.config.planner)
        self.worker.submit(lambda: self.decider.complete(decision), partial(self._tell, plan))

    def _tell(self, plan: Plan, done: "Future[Decision]") -> None:
        """Publish a plan whose push is on its way, with all that is now known of it."""
        decision = done.result()
        if decision.result.regions is not None:
            plan.regions = codec.encode_floats(decision.result.regions)
        self._publish(plan)
        self.marker_publisher.publish(plan_markers(decision, self.get_clock().now().to_msg()))

    def _publish(self, plan: Plan) -> None:
        plan.plan_id = next(self.plan_ids)
        plan.header = codec.header(self.get_clock().now().to_msg())
        self.plan_publisher.publish(plan)
        self.starting = False  # what became of a plan says more
        well = plan.error_code == ErrorCode.OK
        self.diagnostics.set(OK if well else WARN, **summary(plan), pushes=self.pursuit.pushes)

    def _model(self, decision: Decision) -> str:
        if decision.failure is not None:
            return self.config.prior
        return self.config.model if self.remote is None else self.remote.model

    def destroy_node(self) -> None:
        """Stop planning."""
        self.decider.cancel()
        self.worker.close()
        super().destroy_node()


def main() -> None:
    """Run the planner until it is interrupted."""
    node_main(MppiNode, "mppi_node")
