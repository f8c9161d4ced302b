"""How a camera sees a world."""

import numpy as np

from sain_core.scene import MASS, POSE, POSITION, RADIUS, is_settled
from sain_sim.camera.camera import Camera, WorldCameraConfig
from sain_sim.world.parameters import WorldParameters, nominal_parameters, on_a_grid
from sain_sim.world.workcell import WorldConfig

PARAMETERS = WorldParameters(masses=(7.5, 8.5), radii=(0.085, 0.055))
SCENE = on_a_grid(PARAMETERS, WorldConfig().feasibility.table)


def camera(seed=0, parameters=PARAMETERS, **config):
    made = Camera(WorldCameraConfig(**config))
    made.begin(seed, parameters)
    return made


def frames(seen, count, start=0.0):
    for index in range(count):
        seen.observe(SCENE, start + index * seen.period)
    return seen.arrived(np.inf)


def test_an_exact_camera_sees_the_truth():
    assert frames(camera(), 1)[0].scene.tobytes() == SCENE.tobytes()


def test_noise_has_its_size_and_a_new_draw_in_each_frame():
    seen = np.stack([frame.scene for frame in frames(camera(noise="0.005,0.035"), 400)])
    scatter = (seen - SCENE)[..., POSE].std(axis=0)
    np.testing.assert_allclose(scatter, [[0.005, 0.005, 0.035]] * 2, rtol=0.15)
    np.testing.assert_allclose(seen.mean(axis=0)[:, POSE], SCENE[:, POSE], atol=0.006)
    assert not any(is_settled(scene) for scene in seen[1:])  # speeds are noise, too


def test_a_bias_stays_in_an_episode_and_is_another_one_in_the_next():
    seen = camera(bias="0.003,0")
    first = {frame.scene[:, POSITION].tobytes() for frame in frames(seen, 3)}
    seen.begin(1, PARAMETERS)
    assert len(first) == 1 and frames(seen, 1)[0].scene[:, POSITION].tobytes() not in first


def test_the_same_seed_and_frames_have_the_same_errors_however_many_were_seen_before():
    one, other = camera(noise="0.005,0"), camera(noise="0.005,0")
    frames(one, 3), frames(other, 30)
    for seen in (one, other):
        seen.count_push()
    assert frames(one, 2)[1].scene.tobytes() == frames(other, 2)[1].scene.tobytes()
    assert frames(camera(1, noise="0.005,0"), 1)[0].scene.tobytes() != (
        frames(camera(2, noise="0.005,0"), 1)[0].scene.tobytes()
    )


def test_a_late_frame_says_when_it_was_observed():
    seen = camera(delay=0.1)
    seen.observe(SCENE, 1.0)
    assert seen.arrived(1.09) == []
    assert [frame.time for frame in seen.arrived(1.1)] == [1.0]
    assert seen.arrived(2.0) == []


def test_masses_that_are_not_measured_are_nominal_and_sizes_stay():
    seen = camera(unknown="mass").measured(SCENE)
    np.testing.assert_array_equal(seen[:, MASS], nominal_parameters().masses)
    np.testing.assert_array_equal(seen[:, RADIUS], SCENE[:, RADIUS])
