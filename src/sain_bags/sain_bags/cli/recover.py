"""``ros2 run sain_bags recover``: a whole bag from what a truncated or damaged one still holds."""

import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import tyro
from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, Progress, TimeRemainingColumn

from sain_bags.recovery.recovery import recover
from sain_bags.recovery.recovery_report import RecoveryOutcome, Report
from sain_bags.recovery.verified_summary import read_sidecar
from sain_core.errors import SainError

LISTED: Final = 20  # losses that are printed one by one


@dataclass(frozen=True)
class RecoverOptions:
    """Save what is undamaged in a truncated or damaged bag to a new, whole one.

    Exit code: 0 all was saved, 3 something was lost (it says what), 1 nothing could be saved.
    """

    bag: tyro.conf.Positional[Path]
    """A bag's folder, also without metadata.yaml, or an MCAP file."""
    out: Path
    """Folder to make for the new bag; must not exist."""


def describe(report: Report, out: Path) -> list[str]:
    """Return what a recovery came to, line by line."""
    if report.outcome == RecoveryOutcome.NOTHING:
        return ["Nothing could be saved.", *_loss_lines(report)]
    chunks = sum(file.chunks for file in report.files)
    duration = 1e-9 * (report.end - report.start)
    began = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(report.start * 1e-9))
    lines = [
        f"Saved {report.messages:,} messages in {chunks:,} chunks,"
        f" {duration:.1f} s from {began}: {out}"
    ]
    if report.note:
        lines.append(f"Note: {report.note}.")
    if report.outcome == RecoveryOutcome.LOSSLESS:
        damaged = any(file.losses for file in report.files)
        return [*lines, "Nothing was lost" + (", though it is damaged." if damaged else ".")]
    return [*lines, *_loss_lines(report)]


def _loss_lines(report: Report) -> list[str]:
    lines = [f"Lost: {report.lost}."] if report.lost else []
    missing = report.missing
    if missing is None:
        lines.append(
            "Lost: how many messages is not known; nothing whole says how many there were."
        )
    elif missing:
        topics = ", ".join(f"{count:,} of {topic}" for topic, count in sorted(missing.items()))
        lines.append(f"Lost: {sum(missing.values()):,} messages ({topics}).")
    losses = report.losses
    size = sum(loss.end - loss.start for loss in losses)
    chunks = sum(loss.chunk is not None for loss in losses)
    if losses:
        lines.append(f"Damaged places: {len(losses)}; {size:,} bytes, {chunks:,} chunks.")
    lines += [f"  {loss.text(report.start)}" for loss in losses[:LISTED]]
    if len(losses) > LISTED:
        lines.append(f"  and {len(losses) - LISTED:,} more")
    if report.doubtful:
        lines.append(
            f"Beware: {report.doubtful:,} messages that were saved have no CRC of their own;"
            " they have no checksum, so that damage to them is not detected."
        )
    return lines


def run(options: RecoverOptions, console: Console) -> RecoveryOutcome:
    """Recover a bag, showing how far it is, and print what came of it.

    Raises:
        DatasetError: there is no MCAP file at the source.
        OutputError: the new folder exists, or the source or the disk cannot be used.
    """
    total = sum(path.stat().st_size for path in read_sidecar(options.bag).files)
    columns = (BarColumn(), DownloadColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("recover", total=total)
        report = recover(options.bag, options.out, lambda done: progress.advance(task, done))
    for line in describe(report, options.out):
        console.print(line, markup=False, highlight=False)
    return report.outcome


def main() -> None:
    """Run from the command line."""
    options = tyro.cli(RecoverOptions, prog="ros2 run sain_bags recover")
    try:
        sys.exit(run(options, Console(soft_wrap=True)))
    except SainError as error:
        console = Console(stderr=True, soft_wrap=True)
        console.print(f"recover: {error}", style="red", markup=False, highlight=False)
        sys.exit(RecoveryOutcome.NOTHING)


if __name__ == "__main__":
    main()
