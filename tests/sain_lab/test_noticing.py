"""What errors show: who predicts better, and that a table has changed."""

from itertools import pairwise

import numpy as np
import pytest

from sain_lab.judging.judge import FEWEST, Judge
from sain_lab.physics import latest_run
from sain_lab.storage.laboratory import PHYSICS, PLANAR, SHIPPED
from sain_lab.storage.log import TRAINED

PUSHES = 250
NETWORK = "models/000050"


def judged(rows, judge=None):
    """Return a judge after these errors, and what was in service on each push."""
    judge, service = judge or Judge(), []
    for errors in rows:
        service.append(judge.service)
        judge.update(errors)
        decide(judge)
    return judge, service


def decide(judge):
    if (decision := judge.decide()) is not None:
        judge.take({"event": decision[0], "about": decision[2]})


def trained(unseen=()):
    return {"event": TRAINED, "about": {"model": NETWORK, "unseen": list(unseen)}}


@pytest.mark.parametrize("better", [PLANAR, SHIPPED])
def test_what_errs_less_comes_into_service_soon_and_costs_little_until_then(better):
    random = np.random.default_rng(0)
    errors = random.exponential(2.0, (PUSHES, 3)) + 1.0
    rows = [dict(zip((PHYSICS, PLANAR, SHIPPED), row, strict=True)) for row in errors]
    for row in rows:
        row[better] *= 0.7
    _, service = judged(rows)
    chosen = np.array([row[name] for row, name in zip(rows, service, strict=True)])
    assert chosen.mean() < 1.06 * np.mean([row[better] for row in rows])
    assert service[FEWEST - 1] == PHYSICS


def test_a_network_is_judged_on_pushes_that_came_while_it_was_trained():
    judge, _ = judged([{PHYSICS: 2.0, PLANAR: 3.0, SHIPPED: 4.0}] * FEWEST)
    judge.take(trained([1.0] * (FEWEST - 1)))
    assert judge.candidate in judge.contenders
    decide(judge)
    assert judge.service == PHYSICS  # not yet
    judged([{PHYSICS: 2.0, PLANAR: 3.0, SHIPPED: 4.0, NETWORK: 1.0}], judge)
    assert (judge.service, judge.candidate) == (NETWORK, "")
    worse = {PHYSICS: 2.0, PLANAR: 3.0, SHIPPED: 4.0, NETWORK: 9.0}
    judged([worse] * 2 * FEWEST, judge)
    assert (judge.service, judge.candidate) == (PHYSICS, NETWORK)  # it may come back


def test_equal_contenders_rarely_change_places():
    random, changes = np.random.default_rng(1), 0
    for _ in range(10):
        errors = random.exponential(2.0, (PUSHES, 3)) + 1.0
        rows = [dict(zip((PHYSICS, PLANAR, SHIPPED), row, strict=True)) for row in errors]
        service = judged(rows)[1]
        changes += sum(one != other for one, other in pairwise(service))
    assert changes < 10 * PUSHES / 50  # once in 50 pushes


def test_a_jump_is_found_where_it_is_and_none_where_there_is_none():
    random = np.random.default_rng(3)
    level = random.normal(0.0, 0.2, 30)
    assert latest_run(np.append(level, [1.4, 1.3])) == 30
    free = [latest_run(random.normal(0.0, 1.0, 60)) for _ in range(100)]
    assert np.mean(np.array(free) > 0) <= 0.05
