"""Data sets of before mean the same, with pushes of five numbers."""

import numpy as np
import pytest

from sain_core.transitions import ORIGINS, Column
from sain_model.data.recordings import load_recording
from sain_model.data.shard import read_shard
from tests.old_files.reading import FOLDER, KINDS, expected, five


@pytest.mark.parametrize("kind", KINDS)
def test_shards_mean_the_same(kind: str) -> None:
    known, columns = expected(f"{kind}_data"), read_shard(FOLDER / f"{kind}_data/shard-00000.npz")
    known["action"] = five(known["action"])
    assert columns.keys() - set(ORIGINS) == known.keys()
    for name, values in known.items():
        np.testing.assert_array_equal(columns[Column(name)], values)


def test_recordings_of_any_bodies_have_one_width() -> None:
    for kind in KINDS:
        for part in load_recording(FOLDER / f"{kind}_data"):
            assert part.action.shape == (len(part), 5)
