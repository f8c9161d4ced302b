"""``ros2 run sain_bags report``: a bag as one HTML page that needs nothing else."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import tyro
from rich.console import Console

from sain_bags.reading.reader import BAG_HELP, Bag
from sain_bags.report.content import read_content
from sain_bags.report.gathering import Limits, messages_to_read
from sain_bags.report.writing import write_page
from sain_bags.rows.topics import left_out
from sain_core.cli.terminal import transient_bar
from sain_core.config import Config, option, required
from sain_core.errors import OutputError
from sain_core.guarding.kinds import describe
from sain_core.output import OVERWRITE_HELP, claim_file


@dataclass(frozen=True)
class ReportOptions(Config):
    """Write a page that shows a bag: episodes from above, predictions, planning times, gaps.

    The page is one HTML file. It loads nothing, and opens in any browser.
    """

    bag: tyro.conf.Positional[Path] = required(BAG_HELP)
    out: Path | None = option(
        None,
        "the file to write; by default report.html beside the bag's folder, or the MCAP file's name"
        " with .html",
    )
    overwrite: bool = option(False, OVERWRITE_HELP)
    frames: int = option(
        Limits.frames,
        "most scenes in motion of an episode; of more, every second, fourth, ... is shown",
        minimum=1,
    )
    episodes: int = option(
        Limits.episodes, "most episodes shown one by one; the figures are of all", minimum=1
    )


PAGE: Final = "web page"  # how one is described


def default_path(bag: Path) -> Path:
    """Return where a bag's page goes when nobody says so."""
    whole = bag.resolve()
    if whole.is_dir():
        return whole.parent / ("report.html" if whole.name == "bag" else f"{whole.name}.html")
    return whole.with_suffix(".html")


def _check_page(out: Path) -> None:
    """Raise `OutputError` where another result of SAIN stands, such as a shard of a data set."""
    if out.exists() and PAGE not in (what := describe(out) or "is no page"):
        raise OutputError(
            f"{out} {what}; a report replaces only a page: name another --out, or --overwrite"
        )


def run(options: ReportOptions, console: Console) -> None:
    """Write the page of a bag and print where it is.

    Raises:
        DatasetError: it is not a whole, undamaged bag.
        OutputError: the file is there, or cannot be written.
    """
    out = options.out or default_path(options.bag)
    claim_file(out, options.overwrite)
    if not options.overwrite:
        _check_page(out)
    bag = Bag(options.bag)
    limits = Limits(options.frames, options.episodes)
    with transient_bar(console) as progress:
        task = progress.add_task("reading", total=messages_to_read(bag))
        content = read_content(bag, limits, lambda: progress.advance(task))
    write_page(out, content.data)
    for line in left_out(bag):
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    console.print(
        f"{content.episodes:,} episodes, {content.pushes:,} pushes:"
        f" {out} ({out.stat().st_size / 1e6:.2f} MB)",
        markup=False,
        highlight=False,
    )
