"""``sain teach``: pushes that inform most, in a simulated world or on the graph that runs."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from sain_core.cli.terminal import make_table
from sain_core.config import option
from sain_core.output import OVERWRITE_HELP, claim_file
from sain_lab.settings import GRAPH, TeachSettings

if TYPE_CHECKING:
    from sain_lab.teaching.lesson_plan import Taught


@dataclass(frozen=True)
class TeachOptions(TeachSettings):
    """Make the pushes that inform most about the plans of a scenario, and learn from them.

    With --world the pushes are made in a simulated world, without ROS. Without it they are made on
    the graph that runs, which `graph --learn` has started with this laboratory, while no goal is
    followed. Each push leaves all bodies in reach. Prints the parameters with their spreads, the
    error before and after, and what as many pushes more would bring; writes a chart.
    """

    out: Path = option(Path("results/teaching.png"), "file for the chart")
    overwrite: bool = option(False, OVERWRITE_HELP)


def run(options: TeachOptions, console: Console) -> None:
    """Teach, print what was learned, and write the chart.

    Raises:
        SainError: no push is possible; the laboratory is open elsewhere, or damaged; nobody
            answers on the graph.
    """
    from sain_core.view.figures import write_png
    from sain_lab.judging.chart import draw_curves
    from sain_lab.judging.curves import read_curves
    from sain_lab.keeping.laboratory import Laboratory
    from sain_model.compute.kernel_store import compile_visibly

    claim_file(options.out, options.overwrite)
    compile_visibly(console)
    if options.world == GRAPH:
        from sain_lab.ros.teaching import teach_on_graph

        taught = teach_on_graph(options)
    else:
        from sain_lab.teaching.lesson_plan import teach_in_world

        taught = teach_in_world(options)
    show(taught, console)
    laboratory = Laboratory.named(options.laboratory)
    path = write_png(draw_curves(read_curves(laboratory), laboratory.name), options.out)
    console.print(f"chart: {path}", soft_wrap=True)


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
