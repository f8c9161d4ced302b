"""When a camera looks at bodies at rest."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sain_sim.camera.camera import Camera, WorldCameraConfig
from sain_sim.ros.pacing import CameraTimer, Pacer
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.world import World


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


@pytest.mark.parametrize("factor", [0.5, 1.0, 4.0])
def test_the_world_waits_for_the_wall(factor):
    pace, wall = pacer(factor)
    for step in range(1, 101):
        pace.follow(step * 0.02)
    assert pace.now == pytest.approx(2.0)
    assert wall.now - 100.0 == pytest.approx(2.0 / factor)


@given(
    st.sampled_from([0.0, 0.5, 1.0, 10.0]),
    st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1), st.booleans()), max_size=30),
)
def test_time_never_goes_back(factor, steps):
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


@pytest.fixture(scope="module")
def sample():
    with World(nominal_parameters()) as world:
        yield world.sample()


def looking(factor, **config):
    camera = Camera(WorldCameraConfig(noise="0.001,0", **config))
    camera.begin(0, nominal_parameters())
    pacer = Pacer(factor, wall=lambda: 0.0)
    return camera, pacer, CameraTimer(camera, pacer, factor, idle_rate=2.0)


def test_late_frames_come_later_and_have_the_time_of_their_observation(sample):
    camera, pacer, eye = looking(0.0, delay=0.1)
    for _ in range(3):
        eye.observe(sample)
    assert camera.arrived(pacer.now) == []
    eye.observe(sample)
    assert [frame.time for frame in camera.arrived(pacer.now)] == [pytest.approx(1 / 30)]
