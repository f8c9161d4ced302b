"""The environment of gym-pusht."""

from typing import Any, Final

from sain_core.errors import ConfigError

NAME: Final = "gym_pusht/PushT-v0"
PICTURE: Final = 320  # [pixels], width and height of its pictures; nothing else depends on them
INSTALL: Final = "pip install gym-pusht gymnasium"


def make_env(steps: int) -> Any:
    """Return gym-pusht's environment as its authors made it, cut off after so many steps.

    Raises:
        ConfigError: it is not installed, or cannot be loaded.
    """
    try:
        import gymnasium
        import gym_pusht  # noqa: F401  # isort: skip  (registers the environment)
    except ImportError as error:
        raise ConfigError(f"gym-pusht cannot be imported ({error}); {INSTALL}") from error
    return gymnasium.make(
        NAME,
        max_episode_steps=steps,
        visualization_width=PICTURE,
        visualization_height=PICTURE,
    )
