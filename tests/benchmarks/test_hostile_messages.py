"""The three nodes under hostile messages, from another process: each is answered, and they live."""

import numpy as np
import pytest

from benchmarks.faults.hostile.entries import PACKAGES, entries, hostile
from benchmarks.faults.hostile_messages import Row, flood_node
from sain_core.ros.node_main import ros_context

pytestmark = pytest.mark.system

COUNT = 60
TEXTS = 2  # of 10 MB
MOST_GROWTH = 20.0  # [MB]
ANSWERED = ("push", "reset_scene", "rollout", "predict_residual", "load_model", "reach")
HARMLESS = 0.06  # share of requests with a wrong number that is never used, such as a velocity


@pytest.mark.parametrize("name", list(PACKAGES))
def test_hostile_messages_are_answered_and_hurt_no_node(ros_domain, name):
    with ros_context():
        rows = list(flood_node(name, COUNT, TEXTS, seed=1))
    assert {row.entry.name for row in rows} == {one.name for one in entries() if one.node == name}
    for row in rows:
        check(row)


def check(row: Row) -> None:
    flood, told = row.flood, " ".join(row)
    assert not row.died, told
    if row.entry.name in ANSWERED:
        assert flood.arrived == flood.answered == flood.sent, told
    if row.entry.name in ("push", "load_model", "reach") or row.kind == "10 MB":
        assert flood.accepted == 0, told
    elif row.entry.fatal:
        assert flood.accepted <= HARMLESS * flood.sent, told
    if row.kind == "10 MB":
        assert row.after - row.before < MOST_GROWTH, told


def test_the_same_seed_makes_the_same_messages_and_leaves_the_valid_one_alone():
    for entry in entries():
        before = repr(entry.valid)
        made = [hostile(entry.valid, entry.fatal, np.random.default_rng(5)) for _ in range(2)]
        assert repr(made[0]) == repr(made[1])
        assert repr(entry.valid) == before
        assert not entry.fatal or repr(made[0]) != before
