"""What each format of a data set costs: processor time and bytes beside the npz shards' own.

    python -m benchmarks.formats [--episodes 200]

Episodes of five pushes, made up, are written from shards as `to_dataset` does after it has read the
recordings. What is done once, importing libraries above all, is timed apart: by writing ten pushes.
"""

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from sain_bags.dataset.card import DatasetCard
from sain_bags.dataset.formats import MADE, StoredRows, find_format
from sain_bags.dataset.formats.sharding import Columns
from sain_core.dataset import SHARD_SIZE, TEST, TRAIN, VALIDATION, shard_path
from sain_core.storage import write_arrays

PUSHES = 5


@dataclass(frozen=True)
class Options:
    """Write made-up pushes in every format."""

    episodes: Annotated[int, tyro.conf.arg(help="of five pushes each")] = 200


def main() -> None:
    options = tyro.cli(Options)
    with tempfile.TemporaryDirectory() as folder:
        rows = made_up(Path(folder) / "rows", options.episodes)
        few = made_up(Path(folder) / "few", 2)
        count = options.episodes * PUSHES
        print(f"{count} pushes; npz: {size(Path(folder) / 'rows') / count:.0f} bytes a push")
        for name in MADE:
            start = time.process_time()
            write = find_format(name)
            if write is None:
                continue
            write(few, Path(folder) / f"{name}-few")
            once = time.process_time() - start
            out, start = Path(folder) / name, time.process_time()
            write(rows, out)
            spent = 1e6 * (time.process_time() - start) / count
            print(
                f"{name}: {spent:.0f} us and {size(out) / count:.0f} bytes a push,"
                f" {once:.1f} s once"
            )


def made_up(folder: Path, episodes: int) -> StoredRows:
    """Write shards of unbroken episodes, and return what a format is written from."""
    card = DatasetCard()
    columns = rows_of(np.repeat(np.arange(episodes), PUSHES))
    paths = []
    for index, start in enumerate(range(0, len(columns["step"]), SHARD_SIZE)):
        shard = {key: values[start : start + SHARD_SIZE] for key, values in columns.items()}
        card.add(shard)
        paths.append(shard_path(folder, index))
        write_arrays(paths[-1], shard)
    parts = {
        TRAIN: frozenset(range(episodes)),
        VALIDATION: frozenset[int](),
        TEST: frozenset[int](),
    }
    return StoredRows("rows", 2, tuple(paths), parts, card.content({}, []))


def rows_of(episode: np.ndarray) -> Columns:
    random, count = np.random.default_rng(0), len(episode)
    step = np.arange(count) % PUSHES
    state = random.normal(size=(count // PUSHES, 1, 16)) + 0.01 * np.arange(PUSHES + 1)[:, None]
    whole = {key: np.arange(count) for key in ("bag_scene", "stamp", "next_stamp", "log_time")}
    ids = {key: np.arange(count, dtype=np.uint64) for key in ("push_id", "bag_episode")}
    return {
        "state": state[:, :-1].reshape(count, 16),
        "action": random.normal(size=(count, 5)),
        "physics_next": random.normal(size=(count, 16)),
        "next_state": state[:, 1:].reshape(count, 16),
        "episode": episode,
        "step": step,
        "masses": np.full((count, 2), 8.0),
        "radii": np.full((count, 2), 0.07),
        "moved": step > 0,
        "duration": random.random(count),
        "goal": np.full((count, 2), 9.0),
        "tolerance": np.full(count, 0.02),
        "outcome": np.ones(count, dtype=np.int64),
        "source": np.full(count, "push_result"),
        "physics_source": np.full(count, "bullet_nominal"),
        "bag_sha256": np.full(count, 64 * "0"),
        **whole,
        **ids,
    }


def size(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


if __name__ == "__main__":
    main()
