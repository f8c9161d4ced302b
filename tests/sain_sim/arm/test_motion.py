import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sain_sim.arm.motion import MotionConfig, trapezoid

MOTION, SPEED = MotionConfig(), 0.2  # [m/s]


@given(st.floats(1e-6, 0.5))
def test_a_profile_goes_from_rest_to_rest_inside_its_limits(length):
    way = trapezoid(length, SPEED, MOTION.acceleration, MOTION.time_step)
    assert way[0] == 0.0
    assert np.isclose(way[-1], length, rtol=1e-12)
    steps = np.diff(way)
    assert (steps >= -1e-15).all()
    assert steps.max() <= SPEED * MOTION.time_step + 1e-12
    limit = MOTION.acceleration * MOTION.time_step**2
    assert np.abs(np.diff(steps, prepend=0.0, append=0.0)).max() <= limit + 1e-12


def test_a_stroke_is_straight_and_low():
    tips = MOTION.stroke(np.array([0.4, 0.1]), np.array([0.5, -0.02]), SPEED)
    assert np.allclose(tips[0], [0.4, 0.1, MOTION.tip_height])
    assert np.allclose(tips[-1], [0.5, -0.02, MOTION.tip_height])
    way = (tips[-1] - tips[0])[:2]
    offset = (tips - tips[0])[:, :2]
    assert np.allclose(way[0] * offset[:, 1], way[1] * offset[:, 0], atol=1e-12)


def test_an_arc_keeps_its_distance_from_the_base():
    tips = MOTION.arc(np.array([0.4, 0.4, 0.09]), np.array([0.3, -0.5, 0.09]))
    distance = np.hypot(tips[:, 0], tips[:, 1])
    low, high = sorted((np.hypot(0.4, 0.4), np.hypot(0.3, 0.5)))
    assert distance.min() >= low - 1e-12
    assert distance.max() <= high + 1e-12


def test_staying_where_one_is_takes_one_tip():
    here = np.array([0.4, 0.1, 0.09])
    assert np.allclose(MOTION.arc(here, here), [here])
