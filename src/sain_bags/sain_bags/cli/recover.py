"""``ros2 run sain_bags recover``: a whole bag from what a truncated or damaged one still holds."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import tyro
from rich.console import Console
from rich.progress import BarColumn, DownloadColumn, Progress, TimeRemainingColumn

from sain_bags.recovery.recovery import recover
from sain_bags.recovery.recovery_report import RecoveryOutcome, Report
from sain_bags.recovery.sidecar import read_sidecar
from sain_core.config import Config, required
from sain_core.errors import DatasetError
from sain_core.output import check_new

LISTED: Final = 20  # losses that are printed one by one


@dataclass(frozen=True)
class RecoverOptions(Config):
    """Save what is undamaged in a truncated or damaged bag to a new, whole one.

    Exit code: 0 all was saved, 3 something was lost (it says what), 1 nothing could be saved.
    """

    bag: tyro.conf.Positional[Path] = required(
        "a bag's folder, also without metadata.yaml, or an MCAP file"
    )
    out: Path = required("folder to make for the new bag; must not exist")


def describe(report: Report, out: Path) -> list[str]:
    """Return what a recovery came to, line by line."""
    if report.outcome == RecoveryOutcome.NOTHING:
        return ["Nothing could be saved.", *_loss_lines(report)]
    chunks = sum(file.chunks for file in report.files)
    duration = 1e-9 * (report.span.end - report.span.start)
    began = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(report.span.start * 1e-9))
    lines = [
        f"Saved {report.messages:,} messages in {chunks:,} chunks,"
        f" {duration:.1f} s from {began}: {out}"
    ]
    if report.sidecar.note:
        lines.append(f"Note: {report.sidecar.note}.")
    if report.outcome == RecoveryOutcome.LOSSLESS:
        damaged = any(file.losses for file in report.files)
        return [*lines, "Nothing was lost" + (", though it is damaged." if damaged else ".")]
    return [*lines, *_loss_lines(report)]


def _loss_lines(report: Report) -> list[str]:
    lines = [f"Lost: {report.sidecar.lost}."] if report.sidecar.lost else []
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
    lines += [f"  {loss.text(report.span.start)}" for loss in losses[:LISTED]]
    if len(losses) > LISTED:
        lines.append(f"  and {len(losses) - LISTED:,} more")
    if report.doubtful:
        lines.append(
            f"Beware: {report.doubtful:,} messages that were saved have no CRC of their own;"
            " they have no checksum, so that damage to them is not detected."
        )
    return lines


def run(options: RecoverOptions, console: Console) -> int:
    """Recover a bag, showing how far it is, and print what came of it.

    Raises:
        DatasetError: there is no MCAP file at the source.
        OutputError: the new folder exists, or the source or the disk cannot be used.
    """
    check_new(options.out)
    try:
        total = sum(path.stat().st_size for path in read_sidecar(options.bag).files)
    except OSError as error:
        raise DatasetError(f"{options.bag} cannot be read: {error}") from error
    columns = (BarColumn(), DownloadColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("recover", total=total)
        report = recover(options.bag, options.out, lambda done: progress.advance(task, done))
    console.soft_wrap = True
    for line in describe(report, options.out):
        console.print(line, markup=False, highlight=False)
    return report.outcome
