"""What errors show: who predicts better, and that a table has changed."""

import numpy as np
import pytest

from sain_lab.judging.sequential_test import Bet
from sain_lab.physics import latest_run

PUSHES = 250


def becomes_certain(gains, errors):
    """Return whether a bet is ever certain of errors that are smaller by these gains."""
    bet = Bet()
    certain = False
    for gain, error in zip(gains, errors, strict=True):
        bet.update(error - gain, error)
        certain = certain or bet.is_certain
    return certain


@pytest.mark.parametrize("share", [0.05, 0.2])
def test_a_steady_gain_becomes_certain_however_small_it_is(share):
    random = np.random.default_rng(0)
    errors = random.exponential(2.0, PUSHES) + 1.0
    assert becomes_certain(share * random.normal(0.3, 1.0, PUSHES), errors)


def test_equal_predictors_are_rarely_taken_for_different():
    random = np.random.default_rng(1)
    certain = [
        becomes_certain(random.standard_t(3, PUSHES), np.full(PUSHES, 9.0)) for _ in range(50)
    ]
    assert np.mean(certain) <= 0.05 + 2.0 * np.sqrt(0.05 * 0.95 / 50)


def test_what_errs_less_often_but_more_in_sum_is_not_better():
    random = np.random.default_rng(2)
    gains = np.where(random.uniform(size=PUSHES) < 0.85, 0.1, -2.0)
    bet = Bet()
    for gain in gains:
        bet.update(3.0 - gain, 3.0)
    assert gains.sum() < 0.0
    assert not bet.is_certain


def test_a_successor_keeps_what_the_bet_has_won_and_no_losses():
    bet = Bet()
    for _ in range(5):
        bet.update(1.0, 2.0)
    assert bet.heir().wealth == bet.wealth > 1.0
    for _ in range(30):
        bet.update(2.0, 1.0)
    assert bet.heir().wealth == 1.0 > bet.wealth


def test_a_jump_is_found_where_it_is_and_none_where_there_is_none():
    random = np.random.default_rng(3)
    level = random.normal(0.0, 0.2, 30)
    assert latest_run(np.append(level, [1.4, 1.3])) == 30
    free = [latest_run(random.normal(0.0, 1.0, 60)) for _ in range(100)]
    assert np.mean(np.array(free) > 0) <= 0.05
