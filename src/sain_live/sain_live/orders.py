"""What a viewer can ask for. The node carries it out; tests of the page take note of it."""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final, Protocol

from sain_core.config import Config
from sain_core.errors import ConfigError
from sain_core.goal import Goal
from sain_eval.scenes.families import AnywhereScenario, PoseScenario
from sain_eval.scenes.scenario_scene import ScenarioScene
from sain_eval.scenes.scenarios import draw_scene, find_scenario
from sain_mppi.config import PlannerConfig

AS_DRAWN: Final = "as the scenario has it"
PREFIX: Final = "planner."  # of its parameters
Field = dataclasses.Field[Any]


@dataclass(frozen=True)
class Reset:
    """A new episode: scenario, seed, shape of its bodies and world."""

    scenario: str
    seed: int
    shape: str = AS_DRAWN
    world: str = ""

    def case(self) -> ScenarioScene:
        """Draw the scene.

        Raises:
            ConfigError: no such scenario, or the shape of its bodies is not free.
        """
        if self.shape == AS_DRAWN:
            return draw_scene(self.scenario, self.seed)
        scenario: Any = find_scenario(self.scenario)
        if isinstance(scenario, PoseScenario):
            return replace(scenario, shape=self.shape).scene(self.seed)
        if isinstance(scenario, AnywhereScenario):
            return replace(scenario, target_shape=self.shape).scene(self.seed)
        raise ConfigError(
            f"the bodies of scenario {self.scenario} have shapes of their own; choose"
            f" {AS_DRAWN!r}, or another scenario such as push_t"
        )


class Orders(Protocol):
    """Each returns at once; what became of it is seen in `LiveState`."""

    def start(self) -> None:
        """Follow the goal, push by push."""

    def pause(self) -> None:
        """Follow no goal any more; a push that is under way ends first."""

    def push_once(self) -> None:
        """Follow the goal for one push."""

    def reset(self, reset: Reset) -> None:
        """Start a new episode."""

    def aim(self, aim: Goal) -> None:
        """Take a goal that was dragged."""

    def set(self, name: str, value: Any) -> None:
        """Change a parameter of the planner."""

    def load(self, model: str) -> None:
        """Serve another model."""


def planner_settings(
    config: Config = PlannerConfig(), prefix: str = PREFIX
) -> Iterator[tuple[str, str, Field, Any]]:
    """Yield group, parameter, field and default of each setting of the planner."""
    group = prefix.removesuffix(".").rpartition(".")[2]
    nested = []
    for item in dataclasses.fields(config):
        value = getattr(config, item.name)
        if isinstance(value, Config):
            nested.append((item.name, value))
        else:
            yield group, prefix + item.name, item, value
    for name, value in nested:
        yield from planner_settings(value, f"{prefix}{name}.")
