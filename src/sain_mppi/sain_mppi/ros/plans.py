"""What a planner publishes: pushes, plans, and their markers."""

from array import array
from collections.abc import Callable
from itertools import count
from time import monotonic
from typing import Final

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.node import Node

from sain_core.errors import ErrorCode, error_reply
from sain_core.guarding.ros.reception import shortened
from sain_core.ros import codec
from sain_core.ros.markers import MarkerBoard, markers_of
from sain_core.ros.node_main import OK, WARN
from sain_core.ros.qos import RELIABLE
from sain_core.scene import POSITION
from sain_core.view.scenes import goal_marks, plan_things, stage
from sain_core.view.things import Thing
from sain_interfaces.msg import Goal, Plan, Push
from sain_mppi.agent.dead_end import DeadEnd
from sain_mppi.agent.events import PlanJob, PushDecision, Stop, StopReason, Task
from sain_mppi.algorithms.sampling import PlanResult
from sain_mppi.ros.goals import Goals
from sain_mppi.ros.watch import Notes, PeerWatch

STATUS: Final = {
    StopReason.REACHED: Plan.REACHED,
    StopReason.EXHAUSTED: Plan.EXHAUSTED,
    StopReason.FAILED: Plan.NO_PUSH,
}
CAUSE: Final = "cause"  # of a dead end, a figure of the diagnostics
SUMMARY: Final = {
    Plan.PUSH: "pushing",
    Plan.REACHED: "goal reached",
    Plan.EXHAUSTED: "no pushes left",
}


class PlanMarkers:
    """The topic of a plan's markers: RViz and Foxglove show them beside the simulator's bodies."""

    def __init__(self, node: Node, topic: str) -> None:
        self._board = MarkerBoard(node, topic)
        self._episode: int | None = None

    def show(self, decision: PushDecision, stamp: Time) -> None:
        """Show a plan."""
        self._episode = decision.job.observed.episode_id
        self._board.show(markers_of(decision_things(decision), stamp))

    def observe(self, episode_id: int) -> None:
        """Clear what is shown once another episode has begun."""
        if self._episode not in (None, episode_id):
            self._episode = None
            self._board.show(())


def decision_things(decision: PushDecision) -> list[Thing]:
    """Return what viewers draw of a decision: the reach, the goal, and the plan if there is one."""
    problem, plan = decision.job.problem, decision.plan
    _, *reach = stage(problem.feasibility)  # the simulator draws the table
    if plan is None:
        return [*reach, *goal_marks(problem.goal, problem.scene, problem.bodies)]
    others = plan.others.predicted[..., POSITION]
    shown = plan_things(
        problem.scene,
        problem.bodies,
        problem.goal,
        plan.pushes,
        plan.predicted,
        plan.regions,
        others,
        problem.feasibility.limits,
    )
    return [*reach, *shown]


class Plans:
    """Publishes what an agent decides, and notes it. Plans of any process are numbered on."""

    def __init__(
        self,
        node: Node,
        goals: Goals,
        notes: Notes,
        watch: PeerWatch,
        model_of: Callable[[PushDecision], str],
    ) -> None:
        self._node, self._goals, self._notes, self._watch = node, goals, notes, watch
        self._model_of = model_of
        self._pushes = node.create_publisher(Push, "push", RELIABLE)
        self.publisher = node.create_publisher(Plan, "plan", RELIABLE)
        self.markers = PlanMarkers(node, "plan_markers")
        self._sent = Plan()  # of the push that was sent last
        self._ids = count(notes.plans + 1)

    def send(self, decision: PushDecision, pushes: int) -> None:
        """Send a push; its plan follows by `show`. So many were sent for the goal."""
        source = self._node.get_fully_qualified_name()
        self._pushes.publish(push_message(decision, self._now(), source))
        self._notes.count(pushes)
        self._sent = plan_of_decision(decision, self._model_of(decision))

    def show(self, decision: PushDecision, pushes: int) -> None:
        """Publish the plan of the latest push, as complete."""
        regions = None if decision.plan is None else decision.plan.regions
        self._sent.regions = codec.encode_floats(np.empty(0) if regions is None else regions)
        self._publish(self._sent, pushes, decision.dead_end)
        self.markers.show(decision, self._now())

    def stop(self, stop: Stop, pushes: int) -> None:
        """Publish that no push follows, and why."""
        self._publish(plan_of_stop(stop), pushes)

    def refuse(self, goal: Goal, error: BaseException, pushes: int) -> None:
        """Publish why a goal cannot be read."""
        plan = Plan(goal_id=goal.goal_id, episode_id=goal.episode_id, status=Plan.NO_PUSH)
        plan.error_code, text = error_reply(error)
        plan.error_message = shortened(text)
        self._publish(plan, pushes)

    def _publish(self, plan: Plan, pushes: int, dead_end: DeadEnd | None = None) -> None:
        plan.plan_id = next(self._ids)
        plan.header = codec.header(self._now())
        self.publisher.publish(plan)
        self._notes.add_plan(plan)  # killed before this, the next process publishes it again
        self._goals.follow(plan, pushes)
        well = plan.error_code in (ErrorCode.OK, ErrorCode.CANCELLED)
        figures = summary(plan)
        if dead_end is not None:
            well, figures = False, figures | {"message": str(dead_end), CAUSE: dead_end.cause}
        self._watch.report(OK if well else WARN, **figures, pushes=pushes)

    def _now(self) -> Time:
        return self._node.get_clock().now().to_msg()


def push_message(decision: PushDecision, stamp: Time, source: str) -> Push:
    """Return the push of a decision."""
    observed = decision.job.observed
    episode_id, scene_id = observed.key
    return codec.encode_push(
        decision.push,
        stamp=stamp,
        push_id=decision.push_id,
        episode_id=episode_id,
        scene_id=scene_id,
        source=source,
        seen=None if observed.uncertainty is None else observed.scene,
    )


def plan_of_decision(decision: PushDecision, model: str) -> Plan:
    """Return the plan whose first push is sent."""
    plan = _empty_plan(decision.job.task, Plan.PUSH, decision.failure)
    _fill_job(plan, decision.job)
    plan.push_id = decision.push_id
    plan.dynamics = model
    plan.fallback = decision.failure is not None
    plan.concern = decision.warning if decision.dead_end is None else str(decision.dead_end)
    if decision.plan is not None:
        _fill_result(plan, decision.plan)
    if (asked := decision.settings) is not None:
        plan.samples, plan.algorithm, plan.deadline = asked.samples, asked.algorithm, asked.deadline
    if decision.last_errors is not None and decision.last_expected is not None:
        plan.last_errors = codec.encode_floats(decision.last_errors)
        plan.last_expected = codec.encode_floats(decision.last_expected)
    return plan


def plan_of_stop(stop: Stop) -> Plan:
    """Return a plan that sends no push, and why."""
    plan = _empty_plan(stop.task, STATUS[stop.reason], stop.error)
    if stop.job is not None:
        _fill_job(plan, stop.job)
    return plan


def _empty_plan(task: Task, status: int, error: BaseException | None) -> Plan:
    plan = Plan(goal_id=task.goal_id, episode_id=task.episode_id, status=status)
    plan.error_code, plan.error_message = (
        (int(ErrorCode.OK), "") if error is None else error_reply(error)
    )
    return plan


def _fill_job(plan: Plan, job: PlanJob) -> None:
    plan.episode_id, plan.scene_id = job.observed.key
    plan.disks = len(job.observed.scene)
    plan.goal_distance = job.judgement.distance
    plan.goal_turn = job.judgement.turn
    plan.planning_time = monotonic() - job.observed.received
    certain = job.observed.uncertainty
    if certain is not None:
        plan.estimate = codec.encode_poses(job.observed.scene, certain.places, certain.turns)


def _fill_result(plan: Plan, result: PlanResult) -> None:
    codec.fill_plan(plan, result.pushes, result.predicted)
    plan.cost, plan.effective_samples = result.cost, result.effective_samples
    plan.rest_cost, plan.rounds, plan.rollouts = result.rest_cost, result.rounds, result.samples
    plan.cost_terms, plan.cost_values = list(result.terms), array("d", result.terms.values())
    times = result.times
    plan.search_time, plan.rollout_time, plan.cost_time = times.total, times.rollout, times.cost
    plan.other_costs = codec.encode_floats(result.others.costs)
    places = result.others.predicted[..., POSITION]
    plan.other_places = array("f", places.astype(np.float32).tobytes())


def summary(plan: Plan) -> dict[str, str]:
    """Return a plan as the message and the figures of a diagnostic."""
    message = SUMMARY.get(plan.status) or plan.error_message or "no push to make"
    if plan.error_code == ErrorCode.CANCELLED:
        message = "goal cancelled"
    if plan.concern:
        message = f"planning wider: {plan.concern}" if plan.algorithm else plan.concern
    if plan.fallback:
        message = f"planning with {plan.dynamics}: {plan.error_message}"
    return {
        "message": message,
        "goal": str(plan.goal_id),
        "goal_distance_m": f"{plan.goal_distance:.4f}",
        "planning_time_s": f"{plan.planning_time:.3f}",
        "error": plan.error_message,
    }
