"""The agent behind the environment's interface plays as an evaluation does."""

import gymnasium
import numpy as np
import pytest

from sain_core.errors import ConfigError, NoPushError
from sain_eval.episode import Tolerance
from sain_eval.loop.closed_loop import agent_maker, run_episode
from sain_eval.loop.play import EpisodeOutcome
from sain_eval.scenes.scenarios import SCENARIOS
from sain_gym import AgentPolicy
from sain_gym.push_env import PushEnv
from sain_sim.world.truth import TruthConfig


def play(env: PushEnv, policy: AgentPolicy, seed: int) -> tuple[list[np.ndarray], dict]:
    """Play an episode until it ends or the policy has no push; return pushes and information."""
    observation, info = env.reset(seed=seed)
    pushes, over = [], False
    while not over:
        try:
            action = policy(observation, info)
        except NoPushError:
            break
        observation, _, terminated, truncated, info = env.step(action)
        if not info["refusal"]:
            pushes.append(env.episode.answer.push)
        over = terminated or truncated
    return pushes, info


def evaluated(env: PushEnv, controller: str, seed: int) -> EpisodeOutcome:
    """Play the same episode as an evaluation does."""
    truth = TruthConfig(engine=env.config.engine)
    case = SCENARIOS[env.config.scenario].scene(seed).within(truth)
    return run_episode(case, agent_maker(controller)(case), Tolerance(env.config.tolerance))


@pytest.mark.parametrize(
    ("scenario", "engine", "controller", "seed"),
    [
        ("anywhere", "mujoco", "planar", 1),
        ("rearrange_2", "bullet", "planar", 0),
        ("paper_shift", "bullet", "straight", 0),
    ],
)
def test_pushes_and_success_are_those_of_an_evaluation(make, scenario, engine, controller, seed):
    env = make(scenario=scenario, engine=engine)
    pushes, info = play(env, AgentPolicy(env, controller), seed)
    outcome = evaluated(env, controller, seed)
    assert [push.tolist() for push in pushes] == [
        record.push.tolist() for record in outcome.record.pushes
    ]
    assert env.scene.tobytes() == outcome.final.tobytes()
    assert info["is_success"] == (outcome.failure == "")
    assert pushes and info["is_success"] == (controller in ("planar", "sain"))
    assert info["refusals"] == outcome.refusals


def test_it_teaches_from_images_and_in_wrappers(make):
    env = gymnasium.make("sain/Push-v0", observation="image")
    wrapped = gymnasium.wrappers.RescaleObservation(env, np.float32(0), np.float32(1))
    alone = make()
    first, second = AgentPolicy(wrapped, "planar"), AgentPolicy(alone, "planar")
    observation, info = wrapped.reset(seed=4)
    assert first(observation, info).tobytes() == second(*alone.reset(seed=4)).tobytes()
    wrapped.close()


def test_other_environments_and_controllers_are_refused(make):
    with pytest.raises(ConfigError, match="the agent plays sain/Push-v0, not CartPoleEnv"):
        AgentPolicy(gymnasium.make("CartPole-v1"))
    with pytest.raises(ConfigError, match="'nobody' is unknown"):
        AgentPolicy(make(), "nobody")
