"""A decision as a message."""

from array import array
from time import monotonic
from typing import Final

import numpy as np

from sain_core.errors import ErrorCode, SainError, error_reply
from sain_core.ros import codec
from sain_core.scene import POSITION, target_distance
from sain_interfaces.msg import Plan
from sain_mppi.loop.agent import Decision
from sain_mppi.loop.goal_tracker import Job, Task, Verdict
from sain_mppi.search.config import PlannerConfig

STATUS: Final = {
    Verdict.PLAN: Plan.PUSH,
    Verdict.REACHED: Plan.REACHED,
    Verdict.EXHAUSTED: Plan.EXHAUSTED,
    Verdict.GIVE_UP: Plan.NO_PUSH,
}
SAID: Final = {
    Plan.PUSH: "pushing",
    Plan.REACHED: "goal reached",
    Plan.EXHAUSTED: "no pushes left",
}


def plan_of_decision(decision: Decision, push_id: int, model: str, config: PlannerConfig) -> Plan:
    """Return the plan whose first push is sent."""
    result = decision.result
    plan = plan_of_job(decision.job, Plan.PUSH)
    plan.push_id = push_id
    plan.dynamics = model
    plan.fallback = decision.failure is not None
    if decision.failure is not None:
        plan.error_code, plan.error_message = error_reply(decision.failure)
    plan.samples, plan.rounds = config.samples, result.rounds
    codec.fill_plan(plan, result.pushes, result.predicted)
    plan.cost, plan.effective_samples = result.cost, result.effective_samples
    plan.rest_cost, plan.concern = result.rest_cost, result.concern
    plan.algorithm, plan.rollouts = config.algorithm, result.samples
    plan.cost_terms, plan.cost_values = list(result.terms), array("d", result.terms.values())
    times = result.times
    plan.search_time, plan.rollout_time, plan.cost_time = times.total, times.rollout, times.cost
    plan.deadline = config.deadline
    if result.last is not None:
        plan.last_errors = codec.encode_floats(result.last.errors)
        plan.last_expected = codec.encode_floats(result.last.expected)
    plan.other_costs = codec.encode_floats(result.others.costs)
    places = result.others.predicted[..., POSITION]
    plan.other_places = array("f", places.astype(np.float32).tobytes())
    return plan


def plan_of_job(job: Job, status: int, error: SainError | None = None) -> Plan:
    """Return a plan that sends no push (yet), and why."""
    plan = plan_of_task(job.task, status, error)
    plan.episode_id, plan.scene_id = job.view.key
    plan.disks = len(job.view.scene)
    plan.goal_distance = float(target_distance(job.view.scene, job.task.goal))
    plan.planning_time = monotonic() - job.view.received
    return plan


def plan_of_task(task: Task, status: int, error: SainError | None = None) -> Plan:
    """Return a plan for a goal without a scene."""
    plan = Plan(goal_id=task.goal_id, episode_id=task.episode_id, status=status)
    plan.error_code, plan.error_message = (
        (int(ErrorCode.OK), "") if error is None else error_reply(error)
    )
    return plan


def summary(plan: Plan) -> dict[str, str]:
    """Return a plan as the message and the figures of a diagnostic."""
    message = SAID.get(plan.status, "no push to make")
    if plan.concern:
        message = f"planning wider: {plan.concern}"
    if plan.fallback:
        message = f"planning with {plan.dynamics}: the model failed"
    return {
        "message": message,
        "goal": str(plan.goal_id),
        "goal_distance_m": f"{plan.goal_distance:.4f}",
        "planning_time_s": f"{plan.planning_time:.3f}",
        "error": plan.error_message,
    }
