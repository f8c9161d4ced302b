"""``ros2 run sain_bags to_dataset``: recordings become training data."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final

import tyro
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn

from sain_bags.dataset.conversion import Converted, convert
from sain_bags.dataset.rows import ConversionConfig
from sain_core.cli.terminal import transient_bar
from sain_core.config import option, required
from sain_core.output import OVERWRITE_HELP, claim_folder
from sain_core.workers import WorkerOptions

if TYPE_CHECKING:
    pass

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
