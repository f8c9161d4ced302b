"""``sain teach``: pushes that inform most, in a simulated world or on the graph that runs."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from rich.console import Console

from sain_core.cli.terminal import make_table
from sain_core.config import Config, option
from sain_eval.scenes.scenarios import OFFERED, SCENARIOS
from sain_lab.keeping.laboratory import laboratory_path
from sain_sim.world.engines import DEFAULT_ENGINE, ENGINE_HELP
from sain_sim.world.truth import ALL, TRUTHS, TruthConfig

if TYPE_CHECKING:
    from sain_lab.teaching.lesson_plan import Taught

GRAPH: Final = "graph"  # in place of a world


@dataclass(frozen=True)
class TeachOptions(Config):
    """Make the pushes that inform most about the plans of a scenario, and learn from them.

    With --world the pushes are made in a simulated world, without ROS. Without it they are made on
    the graph that runs, which `graph --learn` has started with this laboratory, while no goal is
    followed. Each push leaves all bodies in reach. Prints the parameters with their spreads, the
    error before and after, and what as many pushes more would bring.
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
    seed: int = option(0, "of scenes and pushes", minimum=0)
    per_scene: int = option(
        8, "pushes in a scene before it is reset, where there is a simulator", minimum=1
    )

    def __post_init__(self) -> None:
        """Check the fields, the scenario, the world and the laboratory's name."""
        super().__post_init__()
        OFFERED.check(self.scenario)
        laboratory_path(self.laboratory)
        _ = self.truth

    @property
    def truth(self) -> TruthConfig:
        """The simulated world."""
        world = TRUTHS[0] if self.world == GRAPH else self.world
        return TruthConfig(world, self.effects, self.lab, self.engine)


def run(options: TeachOptions, console: Console) -> None:
    """Teach, and print what was learned.

    Raises:
        SainError: no push is possible; the laboratory is open elsewhere, or damaged; nobody
            answers on the graph.
    """
    from sain_model.compute.kernel_store import compile_visibly

    compile_visibly(console)
    if options.world == GRAPH:
        from sain_lab.ros.teaching import teach_on_graph

        taught = teach_on_graph(options)
    else:
        from sain_lab.teaching.lesson_plan import teach_in_world

        taught = teach_in_world(options)
    show(taught, console)


def show(taught: "Taught", console: Console) -> None:
    """Print what was learned."""
    rows = (
        (name, f"{before[0]:.4g}", f"{before[1]:.2g}", f"{after[0]:.4g}", f"{after[1]:.2g}")
        for name, (before, after) in taught.parameters.items()
    )
    columns = ("parameter", "before", "spread", "after", "spread")
    console.print(make_table(f"Physics, {taught.kind}", columns, rows), soft_wrap=True)
    if taught.errors:
        before, after = taught.errors
        console.print(
            f"error of the later half of the pushes, each predicted before it was learned from:"
            f" {before:.2f} mm with what was believed at first, {after:.2f} mm with what was"
            " believed then",
            soft_wrap=True,
        )
    now, later = taught.expected
    console.print(
        f"uncertain parameters cost {now:.2f} mm in plans of the scenario;"
        f" {taught.pushes} pushes more would leave {later:.2f} mm",
        soft_wrap=True,
    )
