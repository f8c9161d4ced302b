"""Collects transitions from many episodes into shards, on several processes.

What is written depends on seed and settings alone: episodes are independent and kept in
order, so neither the number of workers nor a kill and a resume changes a byte.
"""

import json
import multiprocessing
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from sain_core.config import Config, option
from sain_core.errors import DatasetError, OutputError
from sain_sim.episodes import EpisodeConfig, EpisodeRunner
from sain_sim.shards import (
    SHARD_SIZE,
    Transition,
    full_shards,
    last_transition,
    load_shards,
    remove_leftovers,
    write_shard,
)
from sain_sim.truth import RANDOMISED_TRUTH

IDENTITY_FILE: Final = "collection.json"
CARD_FILE: Final = "card.json"

Progress = Callable[[int, int], None]  # episodes done, transitions so far


@dataclass(frozen=True)
class CollectConfig(Config):
    """What to collect, and where to."""

    out: Path = Path("data")
    episodes: int = option(5000, "number of episodes", minimum=1)
    seed: int = option(0, "same seed, same bytes", minimum=0)
    workers: int = option(1, "processes", minimum=1, maximum=256)
    episode: EpisodeConfig = EpisodeConfig()


def collect(config: CollectConfig, progress: Progress = lambda episodes, transitions: None) -> int:
    """Collect, going on where an earlier run with the same settings stopped.

    Args:
        config: what to collect, and where to.
        progress: called after each episode.

    Returns:
        The number of transitions in the folder.

    Raises:
        OutputError: the folder cannot be written.
        DatasetError: the folder holds a collection with other settings, or a damaged shard.
    """
    folder = config.out
    _claim(folder, config)
    remove_leftovers(folder)
    shards = full_shards(folder)
    last = last_transition(folder, shards - 1) if shards else (0, -1)
    waiting: list[Transition] = []
    for done, transitions in enumerate(_episodes(config, last[0]), start=last[0] + 1):
        waiting += [item for item in transitions if (item.episode, item.step) > last]
        while len(waiting) >= SHARD_SIZE:
            write_shard(folder, shards, waiting[:SHARD_SIZE])
            shards, waiting = shards + 1, waiting[SHARD_SIZE:]
        progress(done, shards * SHARD_SIZE + len(waiting))
    if waiting:
        write_shard(folder, shards, waiting)
    total = shards * SHARD_SIZE + len(waiting)
    if total:
        _write_json(folder / CARD_FILE, {**_identity(config), **_summary(folder, config)})
    return total


def _episodes(config: CollectConfig, first: int) -> Iterator[list[Transition]]:
    """Run episodes from the first on and yield their transitions in order."""
    numbers = range(first, config.episodes)
    if config.workers == 1:
        runner = EpisodeRunner(config.seed, config.episode)
        try:
            yield from map(runner.run, numbers)
        finally:
            runner.close()
        return
    context = multiprocessing.get_context("spawn")
    with context.Pool(config.workers, _start_worker, (config.seed, config.episode)) as pool:
        yield from pool.imap(_run_episode, numbers)


_runner: EpisodeRunner | None = None  # of this worker process


def _start_worker(seed: int, config: EpisodeConfig) -> None:
    global _runner
    _runner = EpisodeRunner(seed, config)


def _run_episode(episode: int) -> list[Transition]:
    assert _runner is not None
    return _runner.run(episode)


def _identity(config: CollectConfig) -> dict[str, Any]:
    """Return what makes two collections the same one; the number of episodes may grow."""
    settings = asdict(config.episode)
    if config.episode.truth == RANDOMISED_TRUTH:
        del settings["truth"]  # so that collections from before there was another go on
    return {"seed": config.seed, **settings}


def _claim(folder: Path, config: CollectConfig) -> None:
    """Make the folder ours: new, or one of the same settings."""
    path = folder / IDENTITY_FILE
    if path.exists():
        found = json.loads(path.read_text())
        wanted = _identity(config)
        for name in {**wanted, **found}:
            if found.get(name) != wanted.get(name):
                raise DatasetError(
                    f"{folder} was collected with {name} = {found.get(name)!r},"
                    f" not {wanted.get(name)!r};"
                    " use the same settings to go on, or another folder"
                )
        return
    _write_json(path, _identity(config))


def _summary(folder: Path, config: CollectConfig) -> dict[str, Any]:
    data = load_shards(folder)
    return {
        "episodes": config.episodes,
        "transitions": len(data["episode"]),
        "moved": int(data["moved"].sum()),
        "shard_size": SHARD_SIZE,
        "fields": {name: list(values.shape[1:]) for name, values in data.items()},
    }


def _write_json(path: Path, content: dict[str, Any]) -> None:
    partial = path.with_suffix(".partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(json.dumps(content, indent=2) + "\n")
        partial.replace(path)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}") from error
