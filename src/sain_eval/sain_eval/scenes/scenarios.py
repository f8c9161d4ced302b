"""The scenes that controllers are measured on: each scenario draws one from a seed."""

import logging
from functools import cache
from pathlib import Path
from typing import Final, Protocol, runtime_checkable

from sain_core.errors import ConfigError, SainError
from sain_core.guarding.plugins import Plugins
from sain_core.scene import Table
from sain_core.shapes.bodies import check_bodies
from sain_core.shapes.outlines import NO
from sain_eval.scenes import families
from sain_eval.scenes.anything import ANYTHING, AnythingScenario, is_anything
from sain_eval.scenes.families import ScenarioScene
from sain_sim.world.engines import BULLET, MUJOCO


@runtime_checkable
class Scenario(Protocol):
    """Draws scenes."""

    @property
    def name(self) -> str:
        """What it is called."""

    def scene(self, seed: int) -> ScenarioScene:
        """Draw one scene; the same seed gives the same."""


log = logging.getLogger(__name__)

_SCENARIOS: Final[tuple[Scenario, ...]] = (
    families.PaperScenario(),  # the paper's Table I
    families.PaperScenario("paper_shift", shift=0.02),  # the paper's Fig. 5
    families.PaperScenario("paper_cube", target_shape="cube"),  # the paper's Fig. 6
    families.AnywhereScenario(),
    families.AnywhereScenario("clutter", extra_disks=(1, 3)),
    families.AnywhereScenario("anywhere_cube", target_shape="cube"),
    families.AnywhereScenario("anywhere_rubber", friction=(0.25, 0.45)),  # on a table that grips
    families.PoseScenario("box", shape="box_3x2"),
    families.PoseScenario("push_t", shape="t"),
    families.PoseScenario("shapes"),  # another shape for each seed
    families.IndirectScenario(),
    families.PoseScenario("rearrange_2", count=2),
    families.PoseScenario("rearrange_3", count=3),
    families.PoseScenario("rearrange_4", count=4),
    families.BlockedScenario(),
    families.PoseScenario("streak", shape="t", goals=families.STREAK_GOALS),
)

SCENARIOS: Final[dict[str, Scenario]] = {scenario.name: scenario for scenario in _SCENARIOS}

MORE: Final = f"; {ANYTHING}, {ANYTHING}:BODY or {ANYTHING}:BODY+BODY of a file of outlines"
OFFERED: Final = Plugins("sain.scenarios", "scenario", SCENARIOS, more=MORE)


def scenario_names() -> tuple[str, ...]:
    """Return the names of all scenarios: those that are built in, then those of packages."""
    return (*SCENARIOS, *(name for name in OFFERED.names() if name not in SCENARIOS))


def check_scenario(name: str, outlines: Path | None = None) -> None:
    """Check that there is a scenario of this name; no package is imported. Raises `ConfigError`."""
    if is_anything(name):
        for body in AnythingScenario.named(name, outlines).bodies:
            if body.fair == NO:
                log.warning("%s is no fair flat body: its cross-section varies", body.shape.name)
    else:
        OFFERED.check(name)


def check_in_graph(name: str, engine: str) -> None:
    """Check that the graph can play a scenario of this name; raises `ConfigError`.

    A file of outlines is not read yet: `check_scenario` does.
    """
    if not is_anything(name):
        OFFERED.check(name)
    elif engine == BULLET:
        raise ConfigError(f"scenario {name!r} has bodies of own heights: add --engine {MUJOCO}")


def find_scenario(name: str, outlines: Path | None = None) -> Scenario:
    """Return the scenario of this name, which an installed package may offer.

    Args:
        name: of it.
        outlines: file with the bodies of `anything`; None: the user's own.

    Raises:
        ConfigError: no package offers it, two do, or its package fails; there is no such body.
        DatasetError: the file of outlines cannot be read.
    """
    if is_anything(name):
        return AnythingScenario.named(name, outlines)
    return SCENARIOS[name] if name in SCENARIOS else _offered(name)


_entry = cache(OFFERED.find)  # to look takes some ms


@cache
def _offered(name: str) -> Scenario:
    entry = _entry(name)
    scenario = OFFERED.load(entry)
    if not isinstance(scenario, Scenario) or scenario.name != name:
        raise OFFERED.wrong(
            entry,
            f"{entry.value} is a {type(scenario).__name__}; it must have the method scene and the"
            f" attribute name, which is {name!r}",
        )
    return scenario


def draw_scene(name: str, seed: int, outlines: Path | None = None) -> ScenarioScene:
    """Return one scene of a scenario.

    Raises:
        SainError: as `find_scenario`; or the scenario fails, or draws no scene that can exist.
    """
    scenario = find_scenario(name, outlines)
    if name in SCENARIOS or is_anything(name):
        return scenario.scene(seed)
    entry = _entry(name)
    drawn = OFFERED.guarded(entry, scenario.scene)(seed)
    if not isinstance(drawn, ScenarioScene):
        kind = type(drawn).__name__
        raise OFFERED.wrong(entry, f"it drew a {kind}; it must draw a ScenarioScene")
    try:
        check_bodies(drawn.disks, drawn.bodies, Table())
    except SainError as error:
        raise OFFERED.wrong(entry, f"its scene {seed} cannot exist: {error}") from error
    return drawn
