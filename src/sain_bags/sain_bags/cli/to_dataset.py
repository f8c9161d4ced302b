"""``ros2 run sain_bags to_dataset``: recordings become training data."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import tyro
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from sain_bags.dataset.card_picture import draw_card
from sain_bags.dataset.conversion import ConversionConfig, Converted, convert
from sain_core.errors import SainError

SHOWN: Final = 50  # messages, between two looks at the bar


@dataclass(frozen=True, kw_only=True)
class ToDatasetOptions:
    """Turn recordings into transitions to train on; the same command goes on after a stop."""

    bags: tyro.conf.Positional[tuple[Path, ...]]
    """Bags, MCAP files, or folders with bags below them."""
    out: Path
    """A new or empty folder, or that of a conversion."""
    overwrite: bool = False
    """Make anew what a conversion made there."""
    conversion: ConversionConfig = ConversionConfig()


def main(arguments: list[str] | None = None) -> int:
    """Run from the command line and return the exit code."""
    options = tyro.cli(
        ToDatasetOptions,
        prog="ros2 run sain_bags to_dataset",
        args=arguments,
        config=(tyro.conf.OmitArgPrefixes,),
    )
    console = Console(stderr=True)
    try:
        done = _convert_with_bar(options, console)
        draw_card(options.out)
    except SainError as error:
        console.print(f"[red]error:[/] {escape(str(error))}", highlight=False, soft_wrap=True)
        return 1
    except KeyboardInterrupt:
        console.print("stopped; the same command goes on from the last whole shard")
        return 130
    folder = escape(str(options.out))
    console.print(f"{done.transitions} transitions of {done.episodes} episodes in {folder}")
    for reason, count in done.dropped.items():
        console.print(f"left out: {count} {reason}", highlight=False, soft_wrap=True)
    return 0


def _convert_with_bar(options: ToDatasetOptions, console: Console) -> Converted:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[what]}, left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console) as bar:
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
            options.bags, options.out, options.conversion, options.overwrite, read, write
        )


if __name__ == "__main__":
    sys.exit(main())
