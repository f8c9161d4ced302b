import numpy as np
import pytest

from sain_core.errors import DatasetError, InvalidInputError
from sain_core.push import make_push
from sain_core.scene import MASS, RADIUS, make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.storage import write_arrays
from sain_core.transitions import (
    COLLECTED,
    IMPORTED,
    NEEDED,
    NO_STEP,
    ORIGINS,
    RECORDED,
    SHAPED,
    Column,
    PushHistory,
    draw_parts,
    read_shard,
    travels,
)


def test_every_column_is_explained_and_written_by_someone():
    assert set(COLLECTED) | set(RECORDED) | set(IMPORTED) == set(Column)
    assert set(NEEDED) <= set(COLLECTED) & set(RECORDED) & set(IMPORTED)
    assert set(IMPORTED) - set(COLLECTED) == {*SHAPED, *ORIGINS}
    for column in Column:
        np.dtype(column.dtype)
        assert column.meaning


@pytest.mark.parametrize(
    ("roles", "way"),
    [
        ((), 0.03),
        (("pushable",) * 3, 0.05),
        (("pushable", "fixed", "movable"), 0.05),
        (("pushable", "movable", "pushable"), 0.03),
        (("pushable",), 0.04),
    ],
)
def test_the_way_of_the_target_counts_where_only_other_bodies_move_it(roles, way):
    count = len(roles) or 3
    before = np.zeros((2, count, 8))
    after = before.copy()
    after[1, :, 0] = (0.04, 0.03, 0.05)[:count]
    bodies = Bodies.named(("disk",) * count, roles)
    np.testing.assert_array_equal(travels(before, after, bodies.has_target), [0.0, way])
    assert travels(before[1], after[1], bodies.has_target) == way
    both = travels(after, before, np.array([bodies.has_target, False]))
    np.testing.assert_array_equal(both, [0.0, max(way, *after[1, :, 0])])


SCENE = np.zeros((2, 8))
SCENE[:, MASS], SCENE[:, RADIUS] = 8.0, 0.07
PUSH = make_push(0.1, 0.2, 0.05)


def history(pushes: int) -> PushHistory:
    scenes = np.stack([SCENE] * pushes)
    return PushHistory(scenes, np.stack([PUSH] * pushes), scenes.copy())


def test_a_history_grows_push_by_push_and_leaves_the_old_one_as_it_was():
    begun = PushHistory.empty(2)
    after = SCENE.copy()
    after[1, 0] = 0.3
    grown = begun.then(SCENE, PUSH, after).then(after, 2 * PUSH, SCENE)
    assert (len(begun), len(grown), grown.disks) == (0, 2, 2)
    np.testing.assert_array_equal(grown.action, [PUSH, 2 * PUSH])
    np.testing.assert_array_equal(grown.state, [SCENE, after])
    np.testing.assert_array_equal(grown.next_state, [after, SCENE])
    assert grown.noise is None
    noisy = grown.then(SCENE, PUSH, SCENE, np.array([0.001, 0.002]))
    np.testing.assert_array_equal(noisy.noise, [[0.0, 0.0], [0.0, 0.0], [0.001, 0.002]])
    assert noisy.equals(noisy) and not noisy.latest(2).equals(grown)
    with pytest.raises(InvalidInputError, match=r"noise is -0\.1 m"):
        begun.then(SCENE, PUSH, SCENE, np.array([0.0, -0.1]))


@pytest.mark.parametrize(
    ("field", "change", "text"),
    [
        ("state", lambda a: a[:, :0], r"past state has shape \(P, N, 8\) with N >= 1, not"),
        ("action", lambda a: a[:-1], r"past action has shape \(3, 5\), not \(2, 5\)"),
        ("next_state", lambda a: a[:, [0, 1, 1]], r"past next_state has shape \(3, 2, 8\), no"),
        ("action", lambda a: a * np.nan, r"past action\[0, 0\] is NaN or Inf"),
        ("next_state", lambda a: a + np.inf, r"past next_state\[0, 0, 0\] is NaN or Inf"),
        ("state", lambda a: a * 0.0, "mass or radius that is not positive"),
        ("next_state", lambda a: a + 0.01, "a past push changed a mass or radius"),
    ],
)
def test_what_cannot_be_an_episode_is_refused(field, change, text):
    good = history(3)
    arrays = {name: getattr(good, name) for name in ("state", "action", "next_state")}
    with pytest.raises(InvalidInputError, match=text):
        PushHistory(**{**arrays, field: change(arrays[field])})  # type: ignore[operator]


@pytest.mark.parametrize(("test", "least"), [(0.15, 3), (0.0, 2)])
def test_too_few_episodes_to_divide_are_refused_with_how_many_are_needed(test, least):
    with pytest.raises(DatasetError, match=rf"at least {least} are needed; collect or convert"):
        draw_parts(np.arange(least - 1), 0, 0.1, test)
    assert [part.sum() for part in draw_parts(np.arange(least), 0, 0.1, test)][:2] == [1, 1]


MORE = {Column.RIM_FRICTION: np.nan, Column.DURATION: 1.5, Column.PHYSICS_SOURCE: "theirs"}


@pytest.fixture
def shard():
    scene = make_scene(np.array([(0.4, 0.0), (0.6, 0.1)]), np.full(2, 8.0), np.full(2, 0.05))
    states = np.tile(scene.ravel(), (3, 1))
    columns = dict.fromkeys((Column.STATE, Column.PHYSICS_NEXT, Column.NEXT_STATE), states)
    pushes = np.tile(make_push(0.0, 0.0, 0.1), (3, 1))
    return {**columns, Column.ACTION: pushes, Column.EPISODE: np.arange(3)}


def test_what_a_shard_lacks_has_the_values_that_are_stated(shard, tmp_path):
    write_arrays(tmp_path / "shard.npz", shard)
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
def test_what_is_asked_for_is_checked_too(shard, tmp_path, name, values, text):
    write_arrays(tmp_path / "shard.npz", {**shard, name: np.asarray(values)})
    with pytest.raises(DatasetError, match=f"shard.npz: {text}"):
        read_shard(tmp_path / "shard.npz", MORE)
