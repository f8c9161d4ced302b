"""The three nodes under hostile messages, from another process: each is answered, and they live."""

import pytest

from benchmarks.faults.hostile.entries import PACKAGES, entries
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
