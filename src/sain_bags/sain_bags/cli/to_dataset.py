"""``ros2 run sain_bags to_dataset``: recordings become training data."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import tyro
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from sain_bags.dataset.conversion import ConversionConfig, Converted, convert
from sain_core.config import option, required
from sain_core.workers.running import WorkerOptions

SHOWN: Final = 50  # messages, between two looks at the bar


@dataclass(frozen=True)
class Options(WorkerOptions):
    """Convert recordings to transitions to train on; the same command continues after a stop."""

    bags: tyro.conf.Positional[tuple[Path, ...]] = required(
        "bags, MCAP files, or folders with bags below them"
    )
    out: Path = required("a new or empty folder, or that of a conversion")
    overwrite: bool = option(False, "replace what a conversion made there")
    conversion: ConversionConfig = field(default_factory=ConversionConfig)


def run(options: Options, _: Console) -> None:
    """Convert the recordings, and print what became of them."""
    from sain_bags.dataset.card_picture import draw_card

    console = Console(stderr=True)
    done = _convert_with_bar(options, console)
    draw_card(options.out)
    folder = escape(str(options.out))
    console.print(f"{done.transitions} transitions of {done.episodes} episodes in {folder}")
    for reason, count in done.dropped.items():
        console.print(f"left out: {count} {reason}", highlight=False, soft_wrap=True)


def _convert_with_bar(options: Options, console: Console) -> Converted:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[what]}, left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        reading = bar.add_task("to_dataset", total=None, what="messages")
        writing = bar.add_task(options.conversion.format, visible=False, what="transitions written")

        shown = 0

        def read(messages: int, of: int, rows: int) -> None:
            nonlocal shown
            if messages >= shown + SHOWN or messages == of:
                shown = messages
                what = f"messages, {rows} transitions"
                bar.update(reading, total=of, completed=messages, what=what)

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
