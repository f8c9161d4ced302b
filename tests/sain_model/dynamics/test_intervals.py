"""Regions that hold as often as they say, for errors whose law is known."""

import numpy as np
import pytest

from sain_core.shapes.bodies import Bodies
from sain_model.dynamics.intervals import Intervals, Prediction
from sain_model.training.interval_fit import fit_disk, fit_regions, with_regions
from tests.sain_model.conftest import make_part


def draw(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Spread of members and friction, way, and errors whose scale and tails depend on them [m]."""
    random = np.random.default_rng(seed)
    parts = np.exp(random.normal([[-9.0], [-8.0], [-4.0]], 1.0, (3, count)))
    scale = 2e-5 + 2.0 * parts[0] + 0.5 * parts[1] + 0.02 * parts[2]
    tails = np.where(parts[2] > 0.02, 2.0, 8.0)  # heavy ones where much moved
    return parts, scale * np.abs(random.standard_t(tails))


def test_regions_hold_as_often_as_they_say_also_where_the_spread_is_small_or_large():
    config = fit_disk(*draw(3000, 0), np.zeros(3000), 0.9)
    parts, off = draw(20_000, 1)
    score = config.score(*parts, 0.0)
    held = off <= config.radius(score)
    assert held.mean() == pytest.approx(0.9, abs=0.015)
    for values in (score, np.hypot(parts[0], parts[1])):
        for rows in np.array_split(np.argsort(values), 3):
            assert held[rows].mean() == pytest.approx(0.9, abs=0.035)
    half = fit_disk(*draw(3000, 0), np.zeros(3000), 0.5)
    assert (off <= half.radius(half.score(*parts, 0.0))).mean() == pytest.approx(0.5, abs=0.02)


def factor(intervals: Intervals, logs: np.ndarray) -> float:
    """The factor of regions after pushes whose errors are larger than usual by logarithms (P,)."""
    total, count = np.array([[logs.sum()], [0.0]]), np.array([len(logs)])
    return float(intervals.widening(total, count)[0, 0])


def test_regions_widen_where_errors_are_larger_than_usual_and_never_shrink():
    intervals = Intervals(usual_log=(-1.0, 0.0), usual_log_std=(1.0, 0.0))
    assert intervals.adapts
    assert not Intervals().adapts
    usual, large = np.zeros(4), np.full(4, np.log(10.0 * np.e))
    assert factor(intervals, usual[:0]) == 1.0
    assert factor(intervals, usual) < 1.02
    assert factor(intervals, usual - np.log(100.0)) == 1.0
    few, many = factor(intervals, large[:1]), factor(intervals, large)
    assert 1.5 < few < many < 12.0 * np.e  # the excess of each is a factor of 10 e
    assert many > 10.0


def test_headings_have_regions_of_the_same_kind():
    random = np.random.default_rng(3)
    scenes = np.zeros((3000, 1, 8))
    scenes[..., 6:] = 0.2, 0.05  # mass and radius
    pushes = np.zeros((3000, 5))
    after = scenes.copy()
    after[:, 0, 0] += 0.02 + random.normal(0.0, 1e-3, 3000)
    after[:, 0, 2] += random.normal(0.0, 0.04, 3000)
    mean = scenes.copy()
    mean[:, 0, 0] += 0.02
    nothing = np.zeros((3000, 1))
    predicted = Prediction(mean, nothing, nothing)
    episode = np.arange(3000)
    bodies = Bodies.named(["box_3x2"])
    part = make_part(scenes, pushes, after, episode, bodies=bodies)
    about = with_regions(fit_regions([predicted], [part]), predicted, part)
    held = np.abs(after[:, 0, 2]) <= about.turn[:, 0]
    assert held.mean() == pytest.approx(0.9, abs=0.02)
    assert about.turn[0, 0] == pytest.approx(1.64 * 0.04, rel=0.15)
    wider = about.widened(np.full((2, 3000), 2.0))
    np.testing.assert_allclose(wider.turn, 2.0 * about.turn)
