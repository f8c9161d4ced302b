import numpy as np
import pytest

from sain_core.cli.terminal import markdown_table
from sain_core.scene import POSITION, TARGET, THETA
from sain_model.evaluation.errors import rank_correlation, shares_removed, target_moved
from sain_model.evaluation.predictors import BULLET, FLOOR


def test_shares_are_of_what_lies_between_the_nominal_world_and_the_floor() -> None:
    means = {BULLET: 5.0, FLOOR: 1.0, "half": 3.0, "worse": 6.0}
    assert shares_removed(means) == {"half": 0.5, "worse": -0.25}


@pytest.mark.parametrize("floor", [5.0, 7.0, None])
def test_without_reducible_error_there_are_no_shares(floor: float | None) -> None:
    known = {} if floor is None else {FLOOR: floor}
    assert shares_removed({BULLET: 5.0, "half": 3.0, **known}) == {}


def test_a_target_moves_by_way_and_not_by_turning() -> None:
    before = np.zeros((3, 2, 8))
    after = before.copy()
    after[0, TARGET, POSITION] = [0.0015, 0.0015]  # 2.1 mm
    after[1, TARGET, THETA] = 1.0
    after[2, 0, POSITION] = [1.0, 1.0]  # the mid disk
    assert target_moved(before, after).tolist() == [True, False, False]


def test_a_table_in_markdown_has_its_names_on_the_left() -> None:
    assert markdown_table(["name", "mm"], [["a", "1"], ["b", "2"]]) == (
        "| name | mm |\n| --- | ---: |\n| a | 1 |\n| b | 2 |\n"
    )


def test_ranks_of_equal_values_are_shared_and_constants_have_none() -> None:
    assert rank_correlation(np.array([1.0, 2.0, 9.0]), np.array([5.0, 6.0, 7.0])) == 1.0
    assert rank_correlation(np.array([1.0, 1.0, 2.0, 2.0]), np.array([1.0, 2.0, 3.0, 4.0])) == (
        pytest.approx(0.894, abs=1e-3)
    )
    assert rank_correlation(np.ones(4), np.arange(4.0)) is None
