"""When a camera looks at bodies at rest."""

import numpy as np
import pytest

from sain_sim.camera.camera import Camera, WorldCameraConfig
from sain_sim.ros.session import NEW, CameraTimer, Pacer
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.world import World


@pytest.fixture(scope="module")
def sample():
    with World(nominal_parameters()) as world:
        yield world.sample()


def looking(factor, **config):
    camera = Camera(WorldCameraConfig(noise="0.001,0", **config))
    camera.begin(0, nominal_parameters())
    pacer = Pacer(factor, wall=lambda: 0.0)
    return camera, pacer, CameraTimer(camera, pacer, factor, idle_rate=2.0)


def test_time_goes_on_from_frame_to_frame_as_fast_as_possible(sample):
    camera, pacer, eye = looking(0.0)
    assert all(eye.observe(sample) for _ in range(10))
    times = [frame.time for frame in camera.arrived(pacer.now)]
    np.testing.assert_allclose(times, np.arange(1, 11) / 30)
    assert eye.timer_period == pytest.approx(1 / 150)


def test_a_scene_that_is_not_new_any_more_is_looked_at_seldom(sample):
    _, _, eye = looking(0.0)
    new = round(NEW * 30)
    assert sum(eye.observe(sample) for _ in range(new)) == new
    assert sum(eye.observe(sample) for _ in range(750)) == 10  # in 5 s, twice a second
    eye.renew()
    assert eye.observe(sample)


def test_late_frames_come_later_and_have_the_time_of_their_observation(sample):
    camera, pacer, eye = looking(0.0, delay=0.1)
    for _ in range(3):
        eye.observe(sample)
    assert camera.arrived(pacer.now) == []
    eye.observe(sample)
    assert [frame.time for frame in camera.arrived(pacer.now)] == [pytest.approx(1 / 30)]
