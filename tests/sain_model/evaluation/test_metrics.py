import numpy as np
import pytest

from sain_core.scene import POSITION, TARGET, THETA
from sain_model.evaluation.markdown import markdown_table
from sain_model.evaluation.metrics import (
    BULLET,
    FLOOR,
    shares_removed,
    target_moved,
)


def test_shares_are_of_what_lies_between_the_nominal_world_and_the_floor() -> None:
    means = {BULLET: 5.0, FLOOR: 1.0, "half": 3.0, "worse": 6.0, "unknown": float("nan")}
    assert shares_removed(means) == {"half": 0.5, "worse": -0.25}


@pytest.mark.parametrize("floor", [5.0, 7.0, float("nan"), None])
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
