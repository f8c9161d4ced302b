"""``ros2 run sain_sim collect``: a training set from one of the truth worlds, in shards.

What is written depends on seed and settings alone: episodes are independent and kept in
order, so neither the number of workers nor a kill and a resume changes a byte.
"""

import logging
import time
from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

from rich.console import Console
from rich.logging import RichHandler
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TimeRemainingColumn

from sain_core.config import MOST_SEED, option
from sain_core.errors import DatasetError
from sain_core.guarding.documents import read_json
from sain_core.output import OVERWRITE_HELP, claim_folder, remove, write_json
from sain_core.transitions import (
    COLLECTION_FILE,
    SHARD_PATTERN,
    SHARD_SIZE,
    Column,
    describe_fields,
)
from sain_core.workers import Work, WorkerOptions, run_on_workers
from sain_sim.collecting.episode import EpisodeConfig, EpisodeResult, EpisodeRunner
from sain_sim.collecting.shards import (
    JOURNAL_FILE,
    CollectionJournal,
    PushCounts,
    ShardWriter,
    load_by_count,
)
from sain_sim.world.engines import DEFAULT_ENGINE, modules_of

CARD_FILE: Final = "card.json"
ANOTHER: Final = "; collect into another folder, or --overwrite"
CONVERSION_FILE: Final = "conversion.json"  # of a converted data set

CollectionProgress = Callable[[int, int], None]  # episodes done, transitions so far


@dataclass(frozen=True)
class CollectConfig(WorkerOptions):
    """Collect transitions from the randomised world or a laboratory into a folder of shards.

    The same command continues after a stop, and ends with the same bytes.
    """

    out: Path = option(Path("data"), "folder for the shards")
    episodes: int = option(5000, "number of episodes", minimum=1)
    seed: int = option(0, "seed; the same seed gives the same bytes", minimum=0, maximum=MOST_SEED)
    episode: EpisodeConfig = EpisodeConfig()
    overwrite: bool = option(False, OVERWRITE_HELP)


class Collected(NamedTuple):
    """What a folder holds when its collection is done."""

    transitions: int
    counts: PushCounts  # of all pushes that were drawn


def collect(
    config: CollectConfig, progress: CollectionProgress = lambda episodes, transitions: None
) -> Collected:
    """Collect, going on where an earlier run with the same settings stopped.

    Args:
        config: what to collect, and where to.
        progress: called before the first and after each episode.

    Raises:
        OutputError: the folder cannot be written, or the disk is full.
        DatasetError: the folder holds a collection with other settings, or a damaged shard.
        ConfigError: there is no such Ray cluster.
        SainError: an episode cannot be run.
    """
    folder = config.out
    _claim(folder, config)
    writer = ShardWriter(folder, config.episode.counts)
    first = writer.first
    progress(first, writer.shards * SHARD_SIZE)
    journal = CollectionJournal(folder, first)
    with closing(_run(config, first)) as results:
        for episode, result in enumerate(results, start=first):
            journal.add(episode, result.counts)
            writer.add(result.transitions)
            progress(episode + 1, writer.rows)
    writer.finish()
    done = Collected(writer.rows, journal.total)
    if done.transitions:
        write_json(folder / CARD_FILE, {**_identity(config), **_summary(config, done)})
    return done


def _run(config: CollectConfig, first: int) -> Generator[EpisodeResult, None, None]:
    """Run episodes from the first on and yield what they gave in order."""
    engines = modules_of((DEFAULT_ENGINE, config.episode.truth.engine))
    work = Work(
        partial(EpisodeRunner, config.seed, config.episode),
        ("sain_core", "sain_sim"),
        ("numpy", *engines),
    )
    return run_on_workers(work, range(first, config.episodes), config)


def _identity(config: CollectConfig) -> dict[str, Any]:
    """Return what makes two collections the same one; the number of episodes may grow."""
    episode = {**asdict(config.episode), "truth": config.episode.truth.settings()}
    return {"seed": config.seed, **episode}


def _claim(folder: Path, config: CollectConfig) -> None:
    """Make the folder ours: new, or one of the same settings."""
    names = COLLECTION_FILE, CARD_FILE, JOURNAL_FILE, SHARD_PATTERN, CONVERSION_FILE
    claim_folder(folder, names, config.overwrite)
    if not _continues(folder, config):
        for path in [path for name in names for path in folder.glob(name)]:
            remove(path)
        write_json(folder / COLLECTION_FILE, _identity(config))


def _continues(folder: Path, config: CollectConfig) -> bool:
    """Return True if a folder has a collection of the same settings, False to begin one.

    Raises:
        DatasetError: it has another data set, which is not to be overwritten.
    """
    others = [*folder.glob(SHARD_PATTERN), *folder.glob(CARD_FILE), *folder.glob(CONVERSION_FILE)]
    path, wanted = folder / COLLECTION_FILE, _identity(config)
    try:
        if not path.exists() and others:
            raise DatasetError(f"{folder} has {others[0].name} and no {COLLECTION_FILE}{ANOTHER}")
        former = _read_identity(path) if path.exists() else {}
        for name in {**wanted, **former} if former else ():
            if former.get(name) != wanted.get(name):
                raise DatasetError(
                    f"{folder} was collected with {name} = {former.get(name)!r},"
                    f" not {wanted.get(name)!r}; use the same settings to go on{ANOTHER}"
                )
    except DatasetError:
        if not config.overwrite:
            raise
        return False
    return bool(former)


def _read_identity(path: Path) -> dict[str, Any]:
    try:
        content = read_json(path)
    except (OSError, ValueError) as error:
        raise DatasetError(f"{path} is damaged: {error}{ANOTHER}") from error
    if not isinstance(content, dict):
        raise DatasetError(f"{path} holds no settings{ANOTHER}")
    return content


def _summary(config: CollectConfig, done: Collected) -> dict[str, Any]:
    former = load_by_count(config.out)
    fields = {str(count): describe_fields(data) for count, data in former.items()}
    rows = {str(count): len(data[Column.EPISODE]) for count, data in former.items()}
    return {
        "episodes": config.episodes,
        "transitions": sum(rows.values()),
        "moved": sum(int(data[Column.MOVED].sum()) for data in former.values()),
        "tally": {"drawn": done.counts.drawn, "valid": done.counts.valid, **asdict(done.counts)},
        "shard_size": SHARD_SIZE,
        **({"bodies": rows} if len(rows) > 1 else {}),
        "fields": next(iter(fields.values())) if len(fields) == 1 else fields,
    }


def run(options: CollectConfig, _: Console) -> None:
    """Collect, and print what was collected."""
    console = Console(stderr=True, soft_wrap=True)
    logging.basicConfig(
        level=logging.WARNING,
        format="%(message)s",
        handlers=[RichHandler(console=console, show_path=False, show_time=False)],
    )
    begun = time.perf_counter()
    done = _collect_with_bar(options, console)
    minutes = (time.perf_counter() - begun) / 60
    folder = escape(str(options.out))
    console.print(f"{done.transitions} transitions in {folder} ({minutes:.1f} min)")
    for line in account(done.counts, options):
        console.print(line, highlight=False, soft_wrap=True)


def account(counts: PushCounts, config: CollectConfig) -> list[str]:
    """Return in words what became of the pushes that were drawn."""
    kept = "kept" if not config.episode.moved_only else "left out"
    lines = [
        f"{counts.drawn} pushes drawn in {counts.episodes} episodes: {counts.unreachable} out of"
        f" reach, {counts.blocked} blocked by another disk, {counts.refused} refused otherwise,"
        f" {counts.edge} ended at the table's edge or still moving, {counts.toppled} tipped a body"
        f" over, {counts.valid} valid",
        f"of these {counts.moved} moved the target by 2 mm or more; {kept}: {counts.missed} that"
        f" missed it, {counts.short} that moved it by less",
    ]
    if counts.stuck:
        lines.append(f"{counts.stuck} episodes ended early: no push that was tried was possible")
    if counts.redrawn:
        lines.append(
            f"{counts.redrawn} worlds were drawn again: a body would tip over, as thin ones do on"
            " tables with much friction"
        )
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
