import pytest
from hypothesis import given
from hypothesis import strategies as st

from sain_sim.ros.session import Pacer


class Wall:
    """A clock on the wall that goes on only when somebody sleeps or the test says so."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds


def pacer(factor: float) -> tuple[Pacer, Wall]:
    wall = Wall()
    return Pacer(factor, wall, wall.sleep), wall


def test_as_fast_as_possible_never_sleeps_and_stands_still_when_idle() -> None:
    pace, wall = pacer(0.0)
    pace.follow(2.5)
    wall.now += 10.0
    pace.idle()
    assert (pace.now, wall.now) == (2.5, 110.0)


@pytest.mark.parametrize("factor", [0.5, 1.0, 4.0])
def test_the_world_waits_for_the_wall(factor: float) -> None:
    pace, wall = pacer(factor)
    for step in range(1, 101):
        pace.follow(step * 0.02)
    assert pace.now == pytest.approx(2.0)
    assert wall.now - 100.0 == pytest.approx(2.0 / factor)


def test_idle_time_passes_with_the_wall_and_stays_passed() -> None:
    pace, wall = pacer(2.0)
    wall.now += 3.0
    pace.idle()
    assert pace.now == pytest.approx(6.0)
    pace.follow(0.5)
    assert pace.now == pytest.approx(6.5)
    assert pace.now_ns == 6_500_000_000


@given(
    st.sampled_from([0.0, 0.5, 1.0, 10.0]),
    st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1), st.booleans()), max_size=30),
)
def test_time_never_goes_back(factor: float, steps: list[tuple[float, float, bool]]) -> None:
    pace, wall = pacer(factor)
    world, last = 0.0, pace.now
    for simulated, passed, rests in steps:
        wall.now += passed
        if rests:
            pace.idle()
        else:
            world += simulated
            pace.follow(world)
        assert pace.now >= last
        last = pace.now
