"""One shard: what it may lack, and what else of it is read where somebody asks."""

import numpy as np
import pytest

from sain_core.errors import DatasetError
from sain_core.push import make_push
from sain_core.scene import make_scene
from sain_core.shard_reading import NO_STEP, read_shard
from sain_core.storage import write_arrays
from sain_core.transitions import Column

MORE = {Column.RIM_FRICTION: np.nan, Column.DURATION: 1.5, Column.PHYSICS_SOURCE: "theirs"}


@pytest.fixture
def arrays():
    scene = make_scene(np.array([(0.4, 0.0), (0.6, 0.1)]), np.full(2, 8.0), np.full(2, 0.05))
    states = np.tile(scene.ravel(), (3, 1))
    columns = dict.fromkeys((Column.STATE, Column.PHYSICS_NEXT, Column.NEXT_STATE), states)
    pushes = np.tile(make_push(0.0, 0.0, 0.1), (3, 1))
    return {**columns, Column.ACTION: pushes, Column.EPISODE: np.arange(3)}


def test_what_a_shard_lacks_has_the_values_that_are_stated(arrays, tmp_path):
    write_arrays(tmp_path / "shard.npz", arrays)
    read = read_shard(tmp_path / "shard.npz", MORE)
    assert read[Column.STATE].shape == (3, 2, 8)
    assert np.isnan(read[Column.RIM_FRICTION]).all() and np.isnan(read[Column.FRICTION]).all()
    assert read[Column.DURATION].tolist() == 3 * [1.5] and set(read[Column.STEP]) == {NO_STEP}
    assert set(read[Column.PHYSICS_SOURCE]) == {"theirs"} and set(read[Column.OBJECT]) == {""}
    assert not MORE.keys() & read_shard(tmp_path / "shard.npz").keys()


@pytest.mark.parametrize(
    ("name", "values", "text"),
    [
        (Column.DURATION, [1.0, np.nan, 1.0], "row 1 of duration holds NaN or Inf"),
        (Column.DURATION, np.ones((3, 2)), r"duration has shape \(3, 2\); it should be \(3,\)"),
        (Column.RIM_FRICTION, [0.1, np.nan, np.inf], "row 2 of rim_friction holds Inf"),
        (Column.PHYSICS_SOURCE, np.zeros(3), "physics_source is float64; it should be text"),
    ],
)
def test_what_is_asked_for_is_checked_too(arrays, tmp_path, name, values, text):
    write_arrays(tmp_path / "shard.npz", {**arrays, name: np.asarray(values)})
    with pytest.raises(DatasetError, match=f"shard.npz: {text}"):
        read_shard(tmp_path / "shard.npz", MORE)
