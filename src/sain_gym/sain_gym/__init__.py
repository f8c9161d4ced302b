"""The scenarios as a Gymnasium environment. This import registers ``sain/Push-v0``.

import gymnasium, sain_gym
env = gymnasium.make("sain/Push-v0", scenario="push_t", engine="mujoco", observation="image")
agent = sain_gym.AgentPolicy(env)
"""

from typing import TYPE_CHECKING, Any, Final

import gymnasium

if TYPE_CHECKING:
    from sain_gym.agent_policy import AgentPolicy

__all__ = ["ENVIRONMENT", "AgentPolicy"]

ENVIRONMENT: Final = "sain/Push-v0"

gymnasium.register(id=ENVIRONMENT, entry_point="sain_gym.push_env:PushEnv")


def __getattr__(name: str) -> Any:
    """Load the agent when it is asked for: the environment alone needs no planner."""
    if name == "AgentPolicy":
        from sain_gym.agent_policy import AgentPolicy

        return AgentPolicy
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
