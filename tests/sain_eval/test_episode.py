"""What an episode says about itself."""

from dataclasses import replace

import pytest

from sain_core.scene import MID, POSITION, TARGET, VX


def test_it_is_judged_at_each_tolerance_while_nothing_moves_or_is_lost(episode):
    assert [episode.pushes_to(tolerance) for tolerance in (0.05, 0.02, 0.005)] == [1, 2, None]
    moving, lost = (episode.pushes[-1].after.copy() for _ in range(2))
    moving[TARGET, VX] = 0.1
    lost[0, POSITION] = [0.5, 0.9]
    for after in (moving, lost):
        last = replace(episode.pushes[-1], after=after)
        assert replace(episode, pushes=(episode.pushes[0], last)).pushes_to(0.02) is None


def test_prediction_errors_are_distances(episode):
    assert episode.pushes[0].error(TARGET) == pytest.approx(0.005)
    assert episode.pushes[0].error(MID) == pytest.approx(0.0)
    assert replace(episode.pushes[0], predicted=None).error(TARGET) is None
