"""``ros2 run sain_bags report``: a bag as one HTML page that needs nothing else."""

import sys
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console
from rich.progress import Progress

from sain_bags.reading.reader import Bag
from sain_bags.report.content import read_content
from sain_bags.report.gathering import Limits, messages_to_read
from sain_bags.report.writing import write_page
from sain_core.errors import OutputError, SainError


@dataclass(frozen=True)
class ReportOptions:
    """Write a page that shows a bag: episodes from above, predictions, planning times, gaps.

    The page is one HTML file. It loads nothing, and opens in any browser.
    """

    bag: tyro.conf.Positional[Path]
    """A bag's folder, or its MCAP file."""
    out: Path | None = None
    """The file to write; by default report.html beside the bag's folder, or the MCAP file's name
    with .html."""
    overwrite: bool = False
    """Replace a file that is there."""
    frames: int = Limits.frames
    """Scenes in motion shown of each episode; of more, every second, fourth, ... is."""
    episodes: int = Limits.episodes
    """Episodes that are shown one by one; the figures are of all."""


def default_path(bag: Path) -> Path:
    """Return where a bag's page goes when nobody says so."""
    whole = bag.resolve()
    if whole.is_dir():
        return whole.parent / ("report.html" if whole.name == "bag" else f"{whole.name}.html")
    return whole.with_suffix(".html")


def run(options: ReportOptions, console: Console) -> Path:
    """Write the page of a bag and say where it is.

    Raises:
        DatasetError: it is not a whole, undamaged bag.
        OutputError: the file is there, or cannot be written.
    """
    out = options.out or default_path(options.bag)
    if out.is_dir():
        raise OutputError(f"{out} is a folder; --out names the file to write")
    if out.exists() and not options.overwrite:
        raise OutputError(f"{out} exists; --overwrite replaces it")
    bag = Bag(options.bag)
    limits = Limits(max(options.frames, 1), max(options.episodes, 1))
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("reading", total=messages_to_read(bag))
        content = read_content(bag, limits, lambda: progress.advance(task))
    write_page(out, content.data)
    console.print(
        f"{content.episodes:,} episodes, {content.pushes:,} pushes:"
        f" {out} ({out.stat().st_size / 1e6:.2f} MB)",
        markup=False,
        highlight=False,
    )
    return out


def main() -> None:
    """Run from the command line."""
    options = tyro.cli(ReportOptions, prog="ros2 run sain_bags report")
    try:
        run(options, Console(soft_wrap=True))
    except SainError as error:
        console = Console(stderr=True, soft_wrap=True)
        console.print(f"report: {error}", style="red", markup=False, highlight=False)
        sys.exit(1)


if __name__ == "__main__":
    main()
