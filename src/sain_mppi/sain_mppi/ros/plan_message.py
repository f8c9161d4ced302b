"""A decision as a message."""

from array import array
from time import monotonic
from typing import Final

import numpy as np
from builtin_interfaces.msg import Time

from sain_core.errors import ErrorCode, error_reply
from sain_core.ros import codec
from sain_core.ros.reception import shortened
from sain_core.scene import POSITION
from sain_interfaces.msg import Goal, Plan, Push
from sain_mppi.agent.decision import PlanJob, PushDecision, Stop, StopReason, Task
from sain_mppi.algorithms.result import PlanResult

STATUS: Final = {
    StopReason.REACHED: Plan.REACHED,
    StopReason.EXHAUSTED: Plan.EXHAUSTED,
    StopReason.FAILED: Plan.NO_PUSH,
}
SAID: Final = {
    Plan.PUSH: "pushing",
    Plan.REACHED: "goal reached",
    Plan.EXHAUSTED: "no pushes left",
}


def push_message(decision: PushDecision, stamp: Time, source: str) -> Push:
    """Return the push of a decision."""
    episode_id, scene_id = decision.job.view.key
    return codec.encode_push(
        decision.push,
        stamp=stamp,
        push_id=decision.push_id,
        episode_id=episode_id,
        scene_id=scene_id,
        source=source,
        seen=None if decision.job.view.sure is None else decision.job.view.scene,
    )


def plan_of_decision(decision: PushDecision, model: str) -> Plan:
    """Return the plan whose first push is sent."""
    plan = _empty_plan(decision.job.task, Plan.PUSH, decision.failure)
    _fill_job(plan, decision.job)
    plan.push_id = decision.push_id
    plan.dynamics = model
    plan.fallback = decision.failure is not None
    plan.concern = decision.concern
    if decision.plan is not None:
        _fill_result(plan, decision.plan)
    if (asked := decision.settings) is not None:
        plan.samples, plan.algorithm, plan.deadline = asked.samples, asked.algorithm, asked.deadline
    if decision.last is not None:
        plan.last_errors = codec.encode_floats(decision.last.errors)
        plan.last_expected = codec.encode_floats(decision.last.expected)
    return plan


def plan_of_stop(stop: Stop) -> Plan:
    """Return a plan that sends no push, and why."""
    plan = _empty_plan(stop.task, STATUS[stop.reason], stop.error)
    if stop.job is not None:
        _fill_job(plan, stop.job)
    return plan


def plan_of_bad_goal(goal: Goal, error: BaseException) -> Plan:
    """Return a plan that says why a goal cannot be read."""
    plan = Plan(goal_id=goal.goal_id, episode_id=goal.episode_id, status=Plan.NO_PUSH)
    plan.error_code, plan.error_message = error_reply(error)
    plan.error_message = shortened(plan.error_message)
    return plan


def _empty_plan(task: Task, status: int, error: BaseException | None) -> Plan:
    plan = Plan(goal_id=task.goal_id, episode_id=task.episode_id, status=status)
    plan.error_code, plan.error_message = (
        (int(ErrorCode.OK), "") if error is None else error_reply(error)
    )
    return plan


def _fill_job(plan: Plan, job: PlanJob) -> None:
    plan.episode_id, plan.scene_id = job.view.key
    plan.disks = len(job.view.scene)
    plan.goal_distance = job.judgement.distance
    plan.goal_turn = job.judgement.turn
    plan.planning_time = monotonic() - job.view.received
    sure = job.view.sure
    if sure is not None:
        plan.estimate = codec.encode_poses(job.view.scene, sure.places, sure.turns)


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
    message = SAID.get(plan.status, "no push to make")
    if plan.error_code == ErrorCode.CANCELLED:
        message = "goal cancelled"
    if plan.concern:
        message = f"planning wider: {plan.concern}"
    if plan.fallback:
        message = f"planning with {plan.dynamics}: {plan.error_message}"
    return {
        "message": message,
        "goal": str(plan.goal_id),
        "goal_distance_m": f"{plan.goal_distance:.4f}",
        "planning_time_s": f"{plan.planning_time:.3f}",
        "error": plan.error_message,
    }
