"""Our environment, and our agent as a policy, in LeRobot's own evaluation, `lerobot-eval`.

./env --with lerobot python examples/09_lerobot_eval.py
./env --with lerobot python examples/09_lerobot_eval.py --env.type=sain --policy.path=FOLDER

The arguments are those of `lerobot-eval`; those of the first command stand below.
"""

import sys
from collections.abc import Generator
from dataclasses import dataclass, field

import numpy as np
import torch

from sain_core import pretrained  # noqa: F401 - before lerobot
from sain_core.errors import ErrorCode
from sain_core.goal import BodyPose, Goal
from sain_core.policy import ACTION, GOAL, IMAGE, STATE
from sain_core.push import PUSH_SIZE, idle_pushes
from sain_core.scene import MASS, RADIUS
from sain_core.shapes.bodies import Bodies
from sain_core.world import PushRecord
from sain_eval.loop.closed_loop import agent_maker
from sain_eval.loop.play import Play, Sight
from sain_eval.scenes.scenarios import draw_scene
from sain_gym import ENVIRONMENT
from sain_gym.spaces import PushSpaces

from lerobot.configs.policies import PreTrainedConfig  # isort: skip
from lerobot.configs.types import FeatureType, PolicyFeature  # isort: skip
from lerobot.envs.configs import EnvConfig  # isort: skip
from lerobot.policies.pretrained import PreTrainedPolicy  # isort: skip
from lerobot.processor import PolicyProcessorPipeline  # isort: skip
from lerobot.processor.converters import (  # isort: skip
    policy_action_to_transition,
    transition_to_policy_action,
)
from lerobot.scripts import lerobot_eval  # isort: skip

DEFAULT = "--policy.type=sain --env.type=sain --env.scenario=paper"
DEFAULT += " --eval.n_episodes=4 --eval.batch_size=2 --seed=0 --output_dir=lerobot_eval"


@EnvConfig.register_subclass("sain")
@dataclass
class SainEnv(EnvConfig):
    """A scenario of `evaluate`: with `--seed=0`, scene 0 is the first."""

    scenario: str = "anywhere"
    engine: str = "bullet"
    tolerance: float = 0.02  # [m]
    episode_length: int = 40  # pushes, refused ones too
    fps: int = 1
    features_map: dict[str, str] = field(
        default_factory=lambda: {
            ACTION: ACTION, "agent_pos": STATE, "environment_state": GOAL, "pixels": IMAGE
        }
    )  # fmt: skip
    gym_id = ENVIRONMENT

    def __post_init__(self) -> None:
        """State what is observed."""
        flat, kinds = PushSpaces(self.scenario).flat, (FeatureType.STATE, FeatureType.ENV)
        numbers = zip(flat.items(), kinds, strict=True)
        self.features = {key: PolicyFeature(kind, box.shape) for (key, box), kind in numbers}
        self.features["pixels"] = PolicyFeature(FeatureType.VISUAL, (96, 96, 3))
        self.features[ACTION] = PolicyFeature(FeatureType.ACTION, (PUSH_SIZE,))

    @property
    def gym_kwargs(self) -> dict:
        """Settings of the environment."""
        settings = {name: getattr(self, name) for name in ("scenario", "engine", "tolerance")}
        more = {"observation": "lerobot", "render_mode": "rgb_array"}
        return settings | more | {"max_episode_steps": self.episode_length}


@PreTrainedConfig.register_subclass("sain")
@dataclass
class SainConfig(PreTrainedConfig):
    """How our agent plays. It needs no training."""

    controller: str = "sain"  # as `evaluate` calls it
    scenario: str = "paper"  # whose first scene has the shapes and roles of the bodies
    tolerance: float = 0.02  # [m]
    observation_delta_indices = action_delta_indices = reward_delta_indices = None
    get_optimizer_preset = get_scheduler_preset = validate_features = lambda self: None


class Player:
    """Our agent, which plays what it sees of one environment; it stands in for the world, too."""

    def __init__(self, config: SainConfig) -> None:
        case = draw_scene(config.scenario, 0)
        self.agent = agent_maker(config.controller)(case)
        self.bodies, self.tolerance = Bodies.named(case.shapes, case.roles), config.tolerance
        self.goal = self.push = self.pushes = None

    def observe(self) -> np.ndarray:
        """Return the scene as it was seen last."""
        return self.scene

    def act(self, state: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """Return the push for a scene; one that changed nothing counts as refused."""
        rows = state.reshape(-1, 8).astype(np.float64)
        scene = rows[rows[:, RADIUS] > 0.0]
        try:
            if self.goal is None or not self.goes_on(scene, goal):
                self.goal, self.scene = goal, scene
                self.pushes = self.begin(goal.reshape(-1, 5).astype(np.float64))
                self.push = next(self.pushes).push
            else:
                refused = np.array_equal(scene, self.scene)
                code = ErrorCode.BLOCKED if refused else ErrorCode.OK
                record = PushRecord(self.push, self.scene, scene, code=code)
                self.scene = scene
                self.push = self.pushes.send(record).push
        except StopIteration:  # the goal is reached, or the agent gives up
            self.push = idle_pushes()
        return self.push

    def goes_on(self, scene: np.ndarray, goal: np.ndarray) -> bool:
        """Return whether the episode goes on: the same goal, for the same bodies."""
        same_bodies = np.array_equal(scene[:, MASS:], self.scene[:, MASS:])
        return same_bodies and np.array_equal(goal, self.goal)

    def begin(self, rows: np.ndarray) -> Generator:
        """Begin an episode."""
        poses = tuple(
            BodyPose(body, row[1], row[2], row[4] if row[3] else None)
            for body, row in enumerate(rows)
            if row[0]
        )
        goal = Goal(poses).within(self.tolerance, 5 * self.tolerance)
        return Play(self.agent, Sight(self)).pushes([goal], self.bodies, 0)


class SainPolicy(PreTrainedPolicy):
    """Our agent behind the surface of LeRobot's policies: a player for each environment."""

    config_class, name = SainConfig, "sain"

    def reset(self) -> None:
        """Begin new episodes."""
        self.players: list[Player] = []

    def select_action(self, batch: dict, **_: object) -> torch.Tensor:
        """Return pushes (B, 5) for what is seen."""
        states, goals = (batch[key].cpu().numpy() for key in (STATE, GOAL))
        self.players = self.players or [Player(self.config) for _ in states]
        made = zip(self.players, states, goals, strict=True)
        return torch.from_numpy(np.stack([player.act(*seen) for player, *seen in made]))

    def predict_action_chunk(self, batch: dict, **_: object) -> torch.Tensor:
        """Return a chunk of one push (B, 1, 5)."""
        return self.select_action(batch)[:, None]

    def get_optim_params(self) -> dict:
        """Return nothing: there is nothing to train."""
        return {}

    forward = get_optim_params


def make_sain_pre_post_processors(config: SainConfig, dataset_stats: object = None) -> tuple:
    """Return processors that change nothing."""
    ways = {"to_transition": policy_action_to_transition, "to_output": transition_to_policy_action}
    return PolicyProcessorPipeline(steps=[]), PolicyProcessorPipeline(steps=[], **ways)


if __name__ == "__main__":
    sys.argv[1:] = sys.argv[1:] or DEFAULT.split()
    lerobot_eval.main()
