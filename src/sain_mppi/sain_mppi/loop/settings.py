"""All settings of the agent and of the planner's node."""

from dataclasses import dataclass

from sain_core.config import Config, option
from sain_core.feasibility import Feasibility
from sain_mppi.loop.goal_tracker import GoalTrackerConfig
from sain_mppi.search.config import PlannerConfig

SERVICE = "service"
IN_PROCESS = "in_process"


@dataclass(frozen=True)
class AgentConfig(Config):
    """How the agent decides, wherever it runs."""

    prior: str = option("planar", "name of the prior that replaces a failed model")
    seed: int = option(0, "seed; the same seed and scenes give the same plans", minimum=0)
    history: bool = option(True, "infer friction from the earlier pushes of the episode")
    planner: PlannerConfig = PlannerConfig()
    goal_tracker: GoalTrackerConfig = GoalTrackerConfig()
    feasibility: Feasibility = Feasibility()


@dataclass(frozen=True)
class MppiConfig(AgentConfig):
    """What the planner's node plans with."""

    dynamics: str = option(SERVICE, "where the model runs", choices=(SERVICE, IN_PROCESS))
    model: str = option("sain", "model in process: its name, or the path of a checkpoint")
    model_timeout: float = option(
        2.0, "longest wait for a reply of the model", unit="s", minimum=0.01, maximum=600.0
    )
