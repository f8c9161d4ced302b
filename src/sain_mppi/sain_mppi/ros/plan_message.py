"""A decision as a message."""

from time import monotonic
from typing import Final

from sain_core.errors import ErrorCode, SainError, error_reply
from sain_core.ros import codec
from sain_core.scene import target_distance
from sain_interfaces.msg import Plan
from sain_mppi.config import PlannerConfig
from sain_mppi.deciding import Decision
from sain_mppi.pursuit import Job, Task, Verdict

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
    plan.rollout_time = result.times.rollout
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
    messages = {
        Plan.PUSH: "pushing",
        Plan.REACHED: "goal reached",
        Plan.EXHAUSTED: "no pushes left",
    }
    message = messages.get(plan.status, "no push to make")
    if plan.fallback:
        message = f"planning with {plan.dynamics}: the model failed"
    return {
        "message": message,
        "goal": str(plan.goal_id),
        "goal_distance_m": f"{plan.goal_distance:.4f}",
        "planning_time_s": f"{plan.planning_time:.3f}",
        "error": plan.error_message,
    }
