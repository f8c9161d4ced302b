"""What a viewer can ask for. `ros.steering` carries it out; `LiveState` shows what became of it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Self

from sain_core.errors import ConfigError
from sain_core.goal import Goal
from sain_eval.scenes.families import AnywhereScenario, PoseScenario, ScenarioScene
from sain_eval.scenes.scenarios import draw_scene, find_scenario

AS_DRAWN: Final = "as the scenario has it"


@dataclass(frozen=True)
class Follow:
    """Follow the goal, push by push; or for so many pushes."""

    most: int = 0  # pushes; 0: until it is reached


@dataclass(frozen=True)
class Pause:
    """Follow no goal any more; a push that is under way ends first."""


@dataclass(frozen=True, eq=False)
class Reset:
    """Begin a new episode with a scene, in a world; empty: in that of the episode before."""

    case: ScenarioScene
    world: str = ""

    @classmethod
    def draw(
        cls,
        name: str,
        seed: int,
        shape: str = AS_DRAWN,
        world: str = "",
        outlines: Path | None = None,
    ) -> Self:
        """Return the reset to a scene of a scenario, whose bodies have a shape, or are of a file.

        Raises:
            ConfigError: no such scenario, or the shape of its bodies is not free.
        """
        if shape == AS_DRAWN:
            return cls(draw_scene(name, seed, outlines), world)
        scenario: Any = find_scenario(name, outlines)
        if isinstance(scenario, PoseScenario):
            return cls(replace(scenario, shape=shape).scene(seed), world)
        if isinstance(scenario, AnywhereScenario):
            return cls(replace(scenario, target_shape=shape).scene(seed), world)
        raise ConfigError(
            f"the bodies of scenario {name} have shapes of their own; choose {AS_DRAWN!r}, or"
            " another scenario such as push_t"
        )


@dataclass(frozen=True, eq=False)
class SetGoal:
    """Take a goal that was dragged: follow it, unless the loop is paused."""

    goal: Goal


@dataclass(frozen=True)
class SetParameter:
    """Change a parameter of the planner."""

    name: str
    value: Any


@dataclass(frozen=True)
class LoadModel:
    """Serve another model."""

    model: str


@dataclass(frozen=True)
class Learn:
    """Learn from pushes, or not."""

    enabled: bool


Request = Follow | Pause | Reset | SetGoal | SetParameter | LoadModel | Learn
Send = Callable[[Request], None]
"""Returns at once, from any thread."""
