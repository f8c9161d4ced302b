from pathlib import Path

import numpy as np
import pytest

from sain_core.transitions import (
    COLLECTED,
    IMPORTED,
    NEEDED,
    ORIGINS,
    POSED,
    RECORDED,
    SHAPED,
    Column,
    Transitions,
    as_scenes,
    centres,
    describe_fields,
)


def test_a_column_is_its_name_on_disk(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **{Column.NEXT_STATE: np.zeros((1, 16)), Column.SEED: np.ones(1)})
    with np.load(tmp_path / "a.npz") as archive:
        assert archive.files == ["next_state", "seed"]
        assert archive[Column.SEED].tolist() == [1.0]
    assert f"{Column.SEED}" == "seed" and Column("seed") is Column.SEED


def test_shapes_follow_the_number_of_disks() -> None:
    assert Column.STATE.row_shape(2) == (16,)
    assert Column.MASSES.row_shape(3) == (3,)
    assert Column.ACTION.row_shape(5) == (5,)
    assert Column.EPISODE.row_shape(5) == ()


def test_every_column_is_explained_and_written_by_someone() -> None:
    assert set(COLLECTED) | set(RECORDED) | set(IMPORTED) | set(POSED) == set(Column)
    assert set(NEEDED) <= set(COLLECTED) & set(RECORDED) & set(IMPORTED)
    assert set(IMPORTED) - set(COLLECTED) == {*SHAPED, *ORIGINS}
    for column in Column:
        np.dtype(column.dtype)
        assert column.meaning


def test_transitions_are_selected_together() -> None:
    state = np.arange(48.0).reshape(3, 2, 8)
    data = Transitions(state, np.arange(9.0).reshape(3, 3), state + 1.0)
    picked = data.select(np.array([True, False, True]))
    assert (len(picked), picked.disks) == (2, 2)
    np.testing.assert_array_equal(picked.action, [[0.0, 1.0, 2.0], [6.0, 7.0, 8.0]])
    np.testing.assert_array_equal(picked.next_state, picked.state + 1.0)
    assert list(data.arrays) == [Column.STATE, Column.ACTION, Column.NEXT_STATE]


def test_states_are_scenes_row_by_row() -> None:
    states = np.arange(32.0).reshape(2, 16)
    assert as_scenes(states)[1, 0].tolist() == list(range(16, 24))
    assert centres(states)[0].tolist() == [[0.0, 1.0], [8.0, 9.0]]
    assert describe_fields({"state": states, "step": np.arange(2)}) == {"state": [16], "step": []}


@pytest.mark.parametrize("name", ["action", "next_state"])
def test_the_arrays_of_transitions_are_named_as_columns(name: str) -> None:
    assert name in Transitions.__dataclass_fields__ and name in set(Column)
