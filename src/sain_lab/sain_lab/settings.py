"""The settings of the learner's node, and of `teach`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sain_core.config import MOST_SEED, Config, option
from sain_core.output import OVERWRITE_HELP
from sain_core.world import ObservationConfig
from sain_eval.scenes.scenarios import OFFERED, SCENARIOS
from sain_lab.storage.laboratory import laboratory_path
from sain_sim.world.engines import DEFAULT_ENGINE, ENGINE_HELP
from sain_sim.world.truth import ALL, TRUTHS, TruthConfig

GRAPH: Final = "graph"  # in place of a world


@dataclass(frozen=True)
class LearnerConfig(Config):
    """Where and from what the node learns."""

    laboratory: str = option(
        "", "name of the laboratory, or a path with a '/'; it is made where there is none"
    )
    learns: bool = option(
        True, "learn from results; off: the model in service stays as it is", live=True
    )
    trains: bool = option(True, "train networks; off: the physics alone is learned")
    noise: str = option(
        "0,0", "standard deviation of the places [m] and headings [rad] in results: METRES,RADIANS"
    )
    nice: int = option(10, "how far the priority is below that of the graph", minimum=0, maximum=19)
    state_file: str = option("", "file that keeps the name of the run over a crash; empty: none")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.laboratory:
            laboratory_path(self.laboratory)
        ObservationConfig(noise=self.noise)

    @property
    def place_noise(self) -> float:
        """The standard deviation of a place [m]."""
        return ObservationConfig(noise=self.noise).noise_std[0]


@dataclass(frozen=True)
class TeachOptions(Config):
    """Make the pushes that inform most about the plans of a scenario, and learn from them.

    With --world the pushes are made in a simulated world, without ROS. Without it they are made on
    the graph that runs, which `graph --learn` has started with this laboratory, while no goal is
    followed. Each push leaves all bodies in reach. Prints the parameters with their spreads, the
    error before and after, and what as many pushes more would bring; writes a chart.
    """

    laboratory: str = option("my_table", "name of the laboratory, or a path with a '/'")
    pushes: int = option(25, "number of pushes", minimum=1, maximum=10_000)
    scenario: str = option(
        "anywhere", f"whose plans count: {', '.join(SCENARIOS)}, or of an installed package"
    )
    world: str = option(
        GRAPH, f"{', '.join(TRUTHS)}, without ROS; graph: what runs", choices=(GRAPH, *TRUTHS)
    )
    engine: str = option(DEFAULT_ENGINE, ENGINE_HELP)
    effects: str = option(
        ALL, "effects of a rough or measured world: all, none, or a list with commas"
    )
    lab: int = option(0, "number of a rough or measured world", minimum=0)
    seed: int = option(0, "of scenes and pushes", minimum=0, maximum=MOST_SEED)
    out: Path = option(Path("results/teaching.png"), "file for the chart")
    overwrite: bool = option(False, OVERWRITE_HELP)

    def __post_init__(self) -> None:
        super().__post_init__()
        OFFERED.check(self.scenario)
        laboratory_path(self.laboratory)
        _ = self.truth

    @property
    def truth(self) -> TruthConfig:
        """The simulated world."""
        world = TRUTHS[0] if self.world == GRAPH else self.world
        return TruthConfig(world, self.effects, self.lab, self.engine)
