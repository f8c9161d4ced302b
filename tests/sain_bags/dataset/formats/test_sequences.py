"""What other formats take for an episode is unbroken, and ends where the goal is reached."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from sain_bags.dataset.formats.stored_rows import StoredRows, goal_distance, reached
from sain_core.storage import write_arrays
from sain_core.transitions import Columns, shard_path

GOAL = (0.9, 0.0)


def pushes(
    places: Sequence[float], episode: int = 0, steps: Sequence[int] | None = None
) -> Columns:
    """Return pushes that bring the target from each x to the next one."""
    count = len(places) - 1
    states = np.zeros((count + 1, 16))
    states[:, 8] = places
    return {
        "state": states[:-1],
        "next_state": states[1:].copy(),
        "episode": np.full(count, episode),
        "step": np.array(steps or range(count)),
        "goal_poses": np.tile([np.nan, np.nan, np.nan, *GOAL, np.nan], (count, 1)),
        "goal_tolerances": np.tile([np.nan, np.nan, 0.02, np.nan], (count, 1)),
    }


def stored(folder: Path, *shards: Columns) -> StoredRows:
    paths = [shard_path(folder, index) for index in range(len(shards))]
    for path, shard in zip(paths, shards, strict=True):
        write_arrays(path, shard)
    return StoredRows(
        "data", 2, tuple(paths), {"train": frozenset({0, 1}), "test": frozenset()}, {}
    )


def lengths(rows: StoredRows) -> list[int]:
    return [len(sequence["episode"]) for sequence in rows.sequences("train")]


def cut(columns: Columns, *places: int) -> list[Columns]:
    return [
        {key: values[start:end] for key, values in columns.items()}
        for start, end in zip([0, *places], [*places, None], strict=True)
    ]


@pytest.mark.parametrize("places", [(), (1,), (1, 2, 3), (4,)])
def test_an_unbroken_episode_is_one_wherever_shards_end(
    places: tuple[int, ...], tmp_path: Path
) -> None:
    whole = pushes([0.4, 0.5, 0.6, 0.7, 0.8, 0.85])
    (sequence,) = stored(tmp_path, *cut(whole, *places)).sequences("train")
    for key, values in whole.items():
        np.testing.assert_array_equal(sequence[key], values, key)


@pytest.mark.parametrize(("by", "expected"), [(0.0019, [4]), (0.0021, [2, 2])])
@pytest.mark.parametrize("disk", [0, 1])
def test_a_disk_that_lies_elsewhere_breaks_an_episode(
    by: float, expected: list[int], disk: int, tmp_path: Path
) -> None:
    rows = pushes([0.4, 0.5, 0.6, 0.7, 0.8])
    rows["state"][2, 8 * disk + 1] += by
    assert lengths(stored(tmp_path, rows)) == expected


def test_an_episode_ends_where_the_goal_is_reached(tmp_path: Path) -> None:
    rows = pushes([0.4, 0.6, 0.89, 0.7, 0.6])
    assert reached(rows).tolist() == [False, True, False, False]
    np.testing.assert_allclose(goal_distance(rows), [0.3, 0.01, 0.2, 0.3])
    assert lengths(stored(tmp_path, *cut(rows, 2))) == [2, 2]
