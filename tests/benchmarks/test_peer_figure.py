"""When a planner equals another: in the scenes that both played, in no more pushes."""

import pytest

from benchmarks.peer_figure import PeerPoint, points, table

OURS = ("mppi",)


def point(*pushes: float | None, milliseconds: float = 1.0, first: int = 0) -> PeerPoint:
    return PeerPoint("a", 64, dict(enumerate(pushes, first)), milliseconds)


@pytest.mark.parametrize(
    ("peer", "equal"),
    [
        (point(3.0, 4.0, 5.0), True),
        (point(3.0, 5.0, 5.0), False),  # more pushes
        (point(1.0, 1.0, None), False),  # fewer solved
        (point(4.0, 5.0, first=1), True),  # worse in no scene that it played
        (point(9.0, first=7), False),  # no scene in common
    ],
)
def test_a_peer_equals_what_it_solves_as_often_in_no_more_pushes(peer, equal):
    assert peer.equals(point(3.0, 4.0, 5.0)) is equal


def test_only_scenes_solved_by_both_count_for_the_pushes():
    assert point(3.0, 15.0).equals(point(3.0, None))


def line(planner: str, samples: int, seed: int, pushes: int, seconds: float) -> dict:
    key = [planner, samples, seed, "sain"]
    return {"key": key, "success": [True, True], "pushes": [1, pushes], "seconds": [seconds] * 2}


def test_the_table_states_how_much_longer_the_cheapest_equal_peer_takes():
    lines = [
        *(line("mppi", 64, seed, 4, 0.01) for seed in range(3)),
        *(line("peer", 64, seed, 5, 0.01) for seed in range(3)),
        *(line("peer", 256, seed, 4, 0.03) for seed in range(2)),
    ]
    assert [one.planner for one in points(lines, OURS)] == ["mppi", "peer", "peer"]
    first, *others = table(lines, OURS).splitlines()[2:]
    assert first.split("|")[-2].strip() == "3.0"
    assert all(other.split("|")[-2].strip() == "" for other in others)
    assert "none equals it" in table(lines[:6], OURS)
