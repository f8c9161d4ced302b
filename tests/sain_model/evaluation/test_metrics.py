import numpy as np
import pytest

from sain_core.scene import POSITION, TARGET, THETA
from sain_model.evaluation.markdown import markdown_table
from sain_model.evaluation.metrics import (
    BULLET,
    FLOOR,
    bootstrap_over_episodes,
    ratio_over_episodes,
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


def test_a_ratio_of_means_varies_with_the_episodes_and_not_within_one() -> None:
    episodes = np.repeat(np.arange(8), 5)
    below = np.random.default_rng(0).uniform(1.0, 2.0, len(episodes))
    assert ratio_over_episodes(3.0 * below, below, episodes, 0) == pytest.approx([3.0, 3.0, 3.0])
    above = below * np.repeat(np.linspace(1.0, 2.0, 8), 5)
    ratio, low, high = ratio_over_episodes(above, below, episodes, 0)
    assert ratio == pytest.approx(above.sum() / below.sum())
    assert 1.0 < low < ratio < high < 2.0
    ones = np.ones(len(episodes))
    mean, low, high = ratio_over_episodes(above, ones, episodes, 0)
    assert (low, high) == pytest.approx(bootstrap_over_episodes(above, episodes, 0), rel=0.05)
    assert mean == pytest.approx(above.mean())


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
