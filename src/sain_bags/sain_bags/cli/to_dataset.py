"""``ros2 run sain_bags to_dataset``: recordings become training data."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import tyro
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from sain_bags.dataset.conversion import Converted, convert
from sain_bags.dataset.dataset_folder import CARD_FILE, PICTURE_FILE
from sain_bags.dataset.rows import ConversionConfig
from sain_core.cli.terminal import transient_bar
from sain_core.config import option, required
from sain_core.guarding.documents import read_json
from sain_core.output import OVERWRITE_HELP, claim_folder
from sain_core.workers import WorkerOptions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS: Final = 3  # of pictures of a card
SHOWN: Final = 50  # pushes, between two looks at the bar


@dataclass(frozen=True)
class ToDatasetOptions(WorkerOptions):
    """Convert recordings to transitions to train on; the same command continues after a stop."""

    bags: tyro.conf.Positional[tuple[Path, ...]] = required(
        "bags, MCAP files, or folders with bags below them"
    )
    out: Path = required("a new or empty folder, or that of a conversion")
    overwrite: bool = option(False, OVERWRITE_HELP)
    conversion: ConversionConfig = field(default_factory=ConversionConfig)


def run(options: ToDatasetOptions, _: Console) -> None:
    """Convert the recordings, and print what became of them."""
    claim_folder(options.out)
    console = Console(stderr=True, soft_wrap=True)
    done = _convert_with_bar(options, console)
    draw_card(options.out)
    folder = escape(str(options.out))
    console.print(f"{done.transitions} transitions of {done.episodes} episodes in {folder}")
    for note in done.notes:
        console.print(note, highlight=False, soft_wrap=True, markup=False)
    for reason in done.left_out:
        console.print(f"left out: {reason}", highlight=False, soft_wrap=True, markup=False)


def _convert_with_bar(options: ToDatasetOptions, console: Console) -> Converted:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[what]}, left"),
        TimeRemainingColumn(),
    )
    with transient_bar(console, *columns) as bar:
        reading = bar.add_task("to_dataset", total=None, what="pushes")
        writing = bar.add_task(options.conversion.format, visible=False, what="transitions written")

        shown = 0

        def read(pushes: int, of: int, rows: int) -> None:
            nonlocal shown
            if pushes >= shown + SHOWN or pushes == of:
                shown = pushes
                what = f"pushes, {rows} transitions"
                bar.update(reading, total=of, completed=pushes, what=what)

        def write(rows: int, of: int) -> None:
            bar.update(writing, total=of, completed=rows, visible=True)

        return convert(
            options.bags,
            options.out,
            options.conversion,
            options.overwrite,
            read,
            write,
            options,
        )


def draw_card(folder: Path) -> Path:
    """Write the picture of a data set's card beside it, and return its path."""
    from sain_core.view.figures import write_png

    card = read_json(folder / CARD_FILE)
    return write_png(histograms(card["ranges"]), folder / PICTURE_FILE)


def histograms(ranges: Mapping[str, Mapping[str, Any]]) -> "Figure":
    """Return a figure with one histogram for each quantity of a card's ``ranges``."""
    from sain_core.view.figures import TEXT, new_figure, style_axes
    from sain_core.view.palette import PALETTE

    rows = -(-len(ranges) // COLUMNS)
    figure = new_figure(2.2 * COLUMNS, 1.9 * rows)
    axes = figure.subplots(rows, COLUMNS, squeeze=False)
    for one, (name, spread) in zip(axes.ravel(), ranges.items(), strict=False):
        histogram = spread["histogram"]
        edges = np.linspace(histogram["from"], histogram["to"], len(histogram["counts"]) + 1)
        one.stairs(histogram["counts"], edges, fill=True, color=PALETTE.mid)
        outside = f", {histogram['outside']} outside" if histogram["outside"] else ""
        style_axes(one, name.replace("_", " "), xlabel=f"[{spread['unit']}]{outside}")
    for one in axes[:, 0]:
        one.set_ylabel("transitions", fontsize=TEXT)
    for one in axes.ravel()[len(ranges) :]:
        one.remove()
    return figure
