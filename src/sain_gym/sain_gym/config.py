"""The settings of the environment: the keyword arguments of ``gymnasium.make``."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, Self

from gymnasium.error import ClosedEnvironmentError, ResetNeeded

from sain_core.config import Config, option, typed_settings
from sain_core.errors import ConfigError, ErrorCode, SainError, StaleSceneError
from sain_eval.episode import Tolerance
from sain_eval.scenes.scenarios import OFFERED, SCENARIOS
from sain_sim.world.engines import DEFAULT_ENGINE, ENGINE_HELP
from sain_sim.world.truth import RANDOMISED, TRUTHS, TruthConfig

STATE: Final = "state"
IMAGE: Final = "image"
WIDEST: Final = 0.075  # [m]: no scenario starts nearer to its goal


@dataclass(frozen=True)
class PushEnvConfig(Config):
    """What is to be solved, in which world, and what is observed."""

    scenario: str = option(
        "anywhere",
        f"what is to be solved: {', '.join(SCENARIOS)}, or one of an installed package",
    )
    engine: str = option(DEFAULT_ENGINE, ENGINE_HELP)
    world: str = option(RANDOMISED, "the paper's world, or a laboratory", choices=TRUTHS)
    lab: int = option(0, "number of the laboratory", minimum=0)
    observation: str = option(STATE, "what is observed", choices=(STATE, IMAGE))
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
        """Check the fields, the scenario, and that the engine has the effects of the world."""
        super().__post_init__()
        OFFERED.check(self.scenario)
        _ = self.truth

    @classmethod
    def of(cls, settings: Mapping[str, Any]) -> Self:
        """Return the settings of these names and values.

        Raises:
            ConfigError: an unknown name, a value of another type or outside its range.
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
