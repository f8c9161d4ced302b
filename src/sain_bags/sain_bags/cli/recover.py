"""``ros2 run sain_bags recover``: a new bag of what a damaged one still holds."""

import time
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, TimeRemainingColumn

from sain_bags.bag.metadata import find_parts
from sain_bags.recovery import Recovered, recover
from sain_core.cli.terminal import transient_bar
from sain_core.config import Config, required
from sain_core.errors import DatasetError
from sain_core.output import check_new


@dataclass(frozen=True)
class RecoverOptions(Config):
    """Copy what can be read of a truncated or damaged bag to a new, whole one.

    Each file is read up to its first damage.
    Exit code: 0 all was saved, 3 something was lost (it says what), 1 nothing could be saved.
    """

    bag: tyro.conf.Positional[Path] = required(
        "a bag's folder, also without metadata.yaml, or an MCAP file"
    )
    out: Path = required("folder to make for the new bag; must not exist")


def describe(found: Recovered, out: Path) -> list[str]:
    """Return the result of a recovery, line by line."""
    lost = [f"  {loss}" for loss in found.losses]
    span = found.span
    if not span.messages:
        return ["Nothing could be saved.", *lost]
    began = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(span.start * 1e-9))
    lines = [f"Saved {span.messages:,} messages, {1e-9 * (span.end - span.start):.1f} s"]
    lines[0] += f" from {began}: {out}"
    return [*lines, *(["Lost:", *lost] if lost else ["Nothing was lost."])]


def run(options: RecoverOptions, console: Console) -> int:
    """Recover a bag, showing how far it is, and print the result.

    Raises:
        DatasetError: there is no MCAP file at the source.
        OutputError: the new folder exists, or the source or the disk cannot be used.
    """
    check_new(options.out)
    try:
        total = sum(path.stat().st_size for path in find_parts(options.bag))
    except OSError as error:
        raise DatasetError(f"{options.bag} cannot be read: {error}") from error
    columns = (BarColumn(), DownloadColumn(), TimeRemainingColumn())
    with transient_bar(console, *columns) as progress:
        task = progress.add_task("recover", total=total)
        found = recover(options.bag, options.out, lambda done: progress.advance(task, done))
    console.soft_wrap = True
    for line in describe(found, options.out):
        console.print(line, markup=False, highlight=False)
    if not found.span.messages:
        return 1
    return 3 if found.losses else 0
