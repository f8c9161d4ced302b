"""``ros2 run sain_sim collect``: a training set from the randomised or the rough world."""

import logging
import time

from rich.console import Console
from rich.logging import RichHandler
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TimeRemainingColumn

from sain_sim.collecting.collect import CollectConfig, Collected, collect
from sain_sim.collecting.shards import PushCounts


def run(config: CollectConfig, _: Console) -> None:
    """Collect, and print what was collected."""
    console = Console(stderr=True)
    logging.basicConfig(
        level=logging.WARNING,
        format="%(message)s",
        handlers=[RichHandler(console=console, show_path=False, show_time=False)],
    )
    begun = time.perf_counter()
    done = _collect_with_bar(config, console)
    minutes = (time.perf_counter() - begun) / 60
    folder = escape(str(config.out))
    console.print(f"{done.transitions} transitions in {folder} ({minutes:.1f} min)")
    for line in account(done.counts, config):
        console.print(line, highlight=False, soft_wrap=True)


def account(counts: PushCounts, config: CollectConfig) -> list[str]:
    """Return in words what became of the pushes that were drawn."""
    kept = "kept" if not config.episode.moved_only else "left out"
    lines = [
        f"{counts.drawn} pushes drawn in {counts.episodes} episodes: {counts.unreachable} out of"
        f" reach, {counts.blocked} blocked by another disk, {counts.refused} refused otherwise,"
        f" {counts.edge} ended at the table's edge or still moving, {counts.valid} valid",
        f"of these {counts.moved} moved the target by 2 mm or more; {kept}: {counts.missed} that"
        f" missed it, {counts.short} that moved it by less",
    ]
    if counts.stuck:
        lines.append(f"{counts.stuck} episodes ended early: no push that was tried was possible")
    if counts.episodes < config.episodes:
        lines.append(
            f"nothing is written of the pushes of {config.episodes - counts.episodes} more"
        )
    return lines


def _collect_with_bar(config: CollectConfig, console: Console) -> Collected:
    count = "episodes, {task.fields[transitions]} transitions, left"
    columns = ("collect", BarColumn(), MofNCompleteColumn(), count, TimeRemainingColumn())
    with Progress(*columns, console=console) as bar:
        task: TaskID | None = None

        def advance(episodes: int, transitions: int) -> None:
            nonlocal task
            if task is None:  # what an earlier run did says nothing about the time left
                task = bar.add_task(
                    "collect", total=config.episodes, completed=episodes, transitions=transitions
                )
            bar.update(task, completed=episodes, transitions=transitions)

        return collect(config, advance)
