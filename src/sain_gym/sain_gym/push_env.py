"""The environment: a scenario's scenes, pushes as actions, rewards and success of an evaluation."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, Self

import gymnasium
import numpy as np
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.spaces import Box, Dict, Space

from sain_core.config import Config, option, typed_settings
from sain_core.errors import ConfigError, ErrorCode, OutOfRangeError, SainError, StaleSceneError
from sain_core.types import Scene
from sain_core.view.image import TopImage, picture_of
from sain_eval.episode import Tolerance
from sain_eval.scenes.families import ScenarioScene
from sain_eval.scenes.scenarios import SCENARIOS, check_scenario, draw_scene
from sain_gym.episode import PushEpisode
from sain_gym.spaces import AS_LEROBOT, PushSpaces
from sain_sim.world.engines import DEFAULT_ENGINE, ENGINE_HELP
from sain_sim.world.own import open_world
from sain_sim.world.truth import RANDOMISED, TRUTHS, TruthConfig
from sain_sim.world.world import CheckedWorld

FIRST_DRAWN: Final = 1_000_000  # scenes that are drawn have numbers from here on
AFTER_DRAWN: Final = 2**31
RENDER_SIZE: Final = 480  # [px]
RGB_ARRAY: Final = "rgb_array"
SCENE: Final = "scene"  # the option of `reset`
STATE: Final = "state"
IMAGE: Final = "image"
LEROBOT: Final = "lerobot"  # both, by the keys that LeRobot's evaluation expects
WIDEST: Final = 0.075  # [m]: no scenario starts nearer to its goal


@dataclass(frozen=True)
class PushEnvConfig(Config):
    """What is to be solved, in which world, and what is observed."""

    scenario: str = option(
        "anywhere", f"what is to be solved: {', '.join(SCENARIOS)}, or one of an installed package"
    )
    engine: str = option(DEFAULT_ENGINE, ENGINE_HELP)
    world: str = option(RANDOMISED, "the paper's world, or a laboratory", choices=TRUTHS)
    lab: int = option(0, "number of the laboratory", minimum=0)
    observation: str = option(STATE, "what is observed", choices=(STATE, IMAGE, LEROBOT))
    tolerance: float = option(
        0.02, "distance that counts as success", unit="m", minimum=1e-4, maximum=WIDEST
    )
    turn: float = option(
        0.0,
        "turn that counts as success; 0: 5 rad for each metre of the tolerance",
        unit="rad",
        minimum=0.0,
        maximum=3.0,
    )
    refusal_cost: float = option(
        0.05, "taken off the reward of a refused push", unit="m", minimum=0.0, maximum=10.0
    )
    image_size: int = option(
        96, "width and height of observed images", unit="px", minimum=16, maximum=1024
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_scenario(self.scenario)
        _ = self.truth

    @classmethod
    def of(cls, settings: Mapping[str, Any]) -> Self:
        """Return the settings of these names and values.

        Raises `ConfigError`: an unknown name, a value of another type or outside its range.
        """
        known = [item.name for item in fields(cls)]
        if unknown := [name for name in settings if name not in known]:
            raise ConfigError(
                f"the environment has no setting {', '.join(unknown)}; allowed:"
                f" {', '.join(known)}, render_mode"
            )
        try:
            return cls(**typed_settings(cls, settings))
        except TypeError as error:
            raise ConfigError(str(error)) from error

    @property
    def truth(self) -> TruthConfig:
        """The world that executes the pushes."""
        return TruthConfig(world=self.world, lab=self.lab, engine=self.engine)

    @property
    def within(self) -> Tolerance:
        """What counts as success."""
        return Tolerance(self.tolerance, self.turn or None)


class EpisodeEndedError(StaleSceneError, ResetNeeded, code=ErrorCode.STALE_SCENE):
    """A step without an episode: it has ended, or none has begun."""


class EnvironmentClosedError(SainError, ClosedEnvironmentError):
    """A call of an environment that was closed."""


class PushEnv(gymnasium.Env[Any, Any]):
    """One world after another of a scenario; `PushEnvConfig` has its settings.

    The reward is -(d + t / 5): d [m] and t [rad] are the largest distance and turn of a wanted body
    from its goal, after the push. A refused push costs `refusal_cost` more. An episode that fails
    early pays -(d + t / 5) for each push that was left.
    """

    metadata: dict[str, Any] = {"render_modes": [RGB_ARRAY], "render_fps": 2}  # noqa: RUF012

    def __init__(self, render_mode: str | None = None, **settings: Any) -> None:
        """Make the spaces; the engine is loaded at the first `reset`.

        Raises `ConfigError`: an unknown setting, one of another type or outside its range, or an
        engine that is not installed.
        """
        if render_mode not in (None, RGB_ARRAY):
            raise ConfigError(f"render_mode is {render_mode!r}; allowed: None, {RGB_ARRAY!r}")
        self.config = config = PushEnvConfig.of(settings)
        self.render_mode = render_mode
        self.spaces = PushSpaces(config.scenario)
        self.action_space = self.spaces.action
        self.observation_space = self._observed()
        self._world: CheckedWorld | None = None
        self._episode: PushEpisode | None = None
        self._closed = False

    def _observed(self) -> Space[Any]:
        size, kind = self.config.image_size, self.config.observation
        image = Box(0, 255, (size, size, 3), np.uint8)
        if kind == LEROBOT:
            return Dict({**self.spaces.flat, "pixels": image})
        return image if kind == IMAGE else self.spaces.state

    @property
    def episode(self) -> PushEpisode:
        """The episode that was begun last; raises `EpisodeEndedError`: none was."""
        if self._episode is None:
            raise EpisodeEndedError("no episode has begun; call reset first")
        return self._episode

    @property
    def world(self) -> CheckedWorld:
        """The world of the episode; see `episode`."""
        if self._world is None:
            raise EpisodeEndedError("no episode has begun; call reset first")
        return self._world

    @property
    def case(self) -> ScenarioScene:
        """The scene to solve, with the hidden truth about its world; see `episode`."""
        return self.episode.case

    @property
    def scene(self) -> Scene:
        """The scene (N, 8) as it is; see `episode`."""
        return self.episode.scene.copy()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: of the scene, as in an evaluation, and of all scenes that are drawn after it.
            options: ``scene``, a whole number: the scene in place of one that is drawn.

        Raises:
            OutOfRangeError: a scene that is no number from 0 on.
            ConfigError: another option.
            EnvironmentClosedError: after `close`.
        """
        self._check_open()
        wanted = _scene_of(options or {})
        super().reset(seed=seed)
        if wanted is None:
            wanted = seed
        if wanted is None:
            wanted = int(self.np_random.integers(FIRST_DRAWN, AFTER_DRAWN))
        config = self.config
        case = draw_scene(config.scenario, wanted).within(config.truth)
        if len(case.disks) > self.spaces.most:
            raise ConfigError(
                f"scene {wanted} of {config.scenario} has {len(case.disks)} bodies; observations"
                f" have room for {self.spaces.most}, as many as scene 0 has"
            )
        parameters = case.parameters()
        if self._world is None:
            self._world = open_world(parameters, engine=config.engine)
        scene = self._world.reset(case.disks, parameters)
        self._episode = PushEpisode(case, scene, config.within, config.refusal_cost)
        return self._observe(), self._episode.info()

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Execute the push that an action stands for; see `sain_gym.spaces`.

        Raises `InvalidInputError`: another shape, NaN or Inf; nothing has moved; `OutOfRangeError`:
        a number outside its range; nothing has moved; `EpisodeEndedError`: the episode has ended,
        or none has begun; `EnvironmentClosedError`: after `close`.
        """
        self._check_open()
        episode, world = self.episode, self.world
        if episode.over:
            raise EpisodeEndedError(
                f"the episode has ended after {episode.steps} steps; call reset first"
            )
        push = self.spaces.push_of(action)
        try:
            after = world.push(push).after
        except SainError as error:
            verdict = episode.refuse(push, error)
        else:
            verdict = episode.execute(push, after)
        return self._observe(), *verdict, episode.info()

    def _observe(self) -> Any:
        episode, config = self.episode, self.config
        if config.observation == IMAGE:
            return self.picture(config.image_size)
        state = self.spaces.state_of(episode.scene, episode.record.goal)
        if config.observation == STATE:
            return state
        numbers = {AS_LEROBOT[key]: rows.ravel() for key, rows in state.items()}
        return {**numbers, "pixels": self.picture(config.image_size)}

    def picture(self, size: int) -> TopImage:
        """Return the scene and the goal from above, (size, size, 3)."""
        record = self.episode.record
        return picture_of(self.episode.scene, record.bodies, record.goal, size)

    def render(self) -> Any:
        """Return the scene from above, (480, 480, 3); None without a `render_mode`."""
        self._check_open()
        return None if self.render_mode is None else self.picture(RENDER_SIZE)

    def close(self) -> None:
        """End the engine; a second call does nothing."""
        self._closed = True
        if self._world is not None:
            self._world.close()
            self._world = None

    def _check_open(self) -> None:
        if self._closed:
            raise EnvironmentClosedError("the environment is closed; make another one")


def _scene_of(options: dict[str, Any]) -> int | None:
    """Return the scene that options of `reset` name, if any."""
    if unknown := [name for name in options if name != SCENE]:
        raise ConfigError(f"reset has no option {', '.join(map(repr, unknown))}; allowed: {SCENE}")
    scene = options.get(SCENE)
    if scene is None:
        return None
    if isinstance(scene, bool) or not isinstance(scene, int | np.integer) or scene < 0:
        raise OutOfRangeError(f"the option {SCENE} is {scene!r}; allowed: whole numbers from 0 on")
    return int(scene)
