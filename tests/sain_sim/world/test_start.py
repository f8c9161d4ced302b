import numpy as np
import pytest

from sain_core.errors import InvalidInputError, OutOfRangeError
from sain_core.scene import make_scene, surface_gaps
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.start import draw_episode
from sain_sim.world.truth import TruthConfig

GIVEN = make_scene(
    np.array([(0.4, 0.1), (0.6, 0.1), (0.5, -0.2)]), np.array([7.5, 8.5, 7.0]), np.full(3, 0.06)
)


def test_the_seed_decides_what_is_not_given():
    first, start = draw_episode(4, TruthConfig("randomised"))
    again, same = draw_episode(4, TruthConfig("randomised"))
    other, _ = draw_episode(5, TruthConfig("randomised"))
    assert first == again != other
    np.testing.assert_array_equal(start, same)


def test_the_default_start_is_the_paper_s():
    parameters, start = draw_episode(4, TruthConfig("nominal"))
    assert parameters == nominal_parameters()
    assert start[0, :2].tolist() == [0.35, 0.0]
    assert surface_gaps(start)[0, 1] == pytest.approx(0.001)


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        ({"friction": -0.1}, OutOfRangeError, "friction is -0.1; it must be positive"),
        ({"friction": float("nan")}, OutOfRangeError, "friction is nan"),
        ({"shapes": ("disk",)}, InvalidInputError, "1 shapes are given for 3 disks"),
        ({"shapes": ("disk", "cone", "disk")}, InvalidInputError, "shape of body 1 is 'cone'"),
    ],
)
def test_what_does_not_exist_is_refused(arguments, error, text):
    with pytest.raises(error, match=text):
        draw_episode(**({"seed": 0, "truth": TruthConfig(), "scene": GIVEN} | arguments))
