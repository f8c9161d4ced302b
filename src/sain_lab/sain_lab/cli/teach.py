"""``sain teach``: pushes that inform most, in a simulated world or on the graph that runs."""

from typing import TYPE_CHECKING

from rich.console import Console

from sain_core.cli.terminal import make_table
from sain_core.output import claim_file
from sain_lab.settings import GRAPH, TeachOptions

if TYPE_CHECKING:
    from sain_lab.exploration.session import SessionResult


def run(options: TeachOptions, console: Console) -> None:
    """Teach, print what was learned, and write the chart."""
    from sain_core.view.figures import write_png
    from sain_lab.judging.chart import draw_curves
    from sain_lab.judging.curves import curves_of
    from sain_lab.storage.laboratory import Laboratory
    from sain_model.compute.kernel_store import compile_visibly

    claim_file(options.out, options.overwrite)
    compile_visibly(console)
    if options.world == GRAPH:
        from sain_lab.ros.graph_world import teach_on_graph

        result = teach_on_graph(options)
    else:
        from sain_lab.exploration.session import teach_in_world

        result = teach_in_world(options)
    show(result, console)
    laboratory = Laboratory.named(options.laboratory)
    curves = curves_of(laboratory.records())
    path = write_png(draw_curves(curves, laboratory.name), options.out)
    console.print(f"chart: {path}", soft_wrap=True)


def show(result: "SessionResult", console: Console) -> None:
    """Print what was learned."""
    rows = (
        (name, f"{before[0]:.4g}", f"{before[1]:.2g}", f"{after[0]:.4g}", f"{after[1]:.2g}")
        for name, (before, after) in result.parameters.items()
    )
    columns = ("parameter", "before", "spread", "after", "spread")
    console.print(make_table(f"Physics, {result.kind}", columns, rows), soft_wrap=True)
    before, after = result.errors
    console.print(
        f"error of the later half of the pushes, each predicted before it was learned from:"
        f" {before:.2f} mm with what was believed at first, {after:.2f} mm with what was"
        " believed then",
        soft_wrap=True,
    )
    now, later = result.expected
    console.print(
        f"uncertain parameters cost {now:.2f} mm in plans of the scenario;"
        f" {result.pushes} pushes more would leave {later:.2f} mm",
        soft_wrap=True,
    )
