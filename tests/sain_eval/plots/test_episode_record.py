"""What an episode says about itself."""

from dataclasses import replace

import pytest

from sain_core.scene import MID, POSITION, TARGET, VX


def test_it_knows_when_each_tolerance_was_met(episode):
    assert episode.pushes_to(0.05) == 1
    assert episode.pushes_to(0.02) == 2
    assert episode.pushes_to(0.005) is None
    assert episode.last.distance == pytest.approx(0.008)


def test_a_scene_that_moves_or_lost_a_disk_meets_nothing(episode):
    moving = episode.pushes[-1].after.copy()
    moving[TARGET, VX] = 0.1
    lost = episode.pushes[-1].after.copy()
    lost[0, POSITION] = [0.5, 0.9]
    for after in (moving, lost):
        last = replace(episode.pushes[-1], after=after)
        assert replace(episode, pushes=(episode.pushes[0], last)).pushes_to(0.02) is None


def test_prediction_errors_are_distances(episode):
    assert episode.pushes[0].error(TARGET) == pytest.approx(0.005)
    assert episode.pushes[0].error(MID) == pytest.approx(0.0)
    assert replace(episode.pushes[0], predicted=None).error(TARGET) is None
