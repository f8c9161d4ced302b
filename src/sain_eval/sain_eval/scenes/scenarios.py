"""The scenes that controllers are measured on: each scenario draws one from a seed."""

from typing import Final, Protocol

from sain_eval.scenes.disk_scenarios import CONTACT_GAP, AnywhereScenario, PaperScenario
from sain_eval.scenes.scenario_scene import MAX_PUSHES, ScenarioScene
from sain_eval.scenes.shape_scenarios import (
    BlockedScenario,
    IndirectScenario,
    PoseScenario,
    StreakScenario,
)

__all__ = [
    "CONTACT_GAP",
    "MAX_PUSHES",
    "SCENARIOS",
    "AnywhereScenario",
    "PaperScenario",
    "Scenario",
    "ScenarioScene",
]


class Scenario(Protocol):
    """Draws scenes."""

    @property
    def name(self) -> str:
        """What it is called."""

    def scene(self, seed: int) -> ScenarioScene:
        """Draw one scene; the same seed gives the same."""


_SCENARIOS: Final[tuple[Scenario, ...]] = (
    PaperScenario(),  # the paper's Table I
    PaperScenario("paper_shift", shift=0.02),  # the paper's Fig. 5
    PaperScenario("paper_cube", target_shape="cube"),  # the paper's Fig. 6
    AnywhereScenario(),
    AnywhereScenario("clutter", extra_disks=(1, 3)),
    AnywhereScenario("anywhere_cube", target_shape="cube"),
    AnywhereScenario("anywhere_rubber", friction=(0.25, 0.45)),  # on a table that grips
    PoseScenario("box", shape="box_3x2"),
    PoseScenario("push_t", shape="t"),
    PoseScenario("shapes"),  # another shape for each seed
    IndirectScenario(),
    PoseScenario("rearrange_2", count=2),
    PoseScenario("rearrange_3", count=3),
    PoseScenario("rearrange_4", count=4),
    BlockedScenario(),
    StreakScenario(),
)

SCENARIOS: Final[dict[str, Scenario]] = {scenario.name: scenario for scenario in _SCENARIOS}
