"""What a network corrects of the physics' parameters is always possible."""

import numpy as np
import pytest

from sain_core.errors import InvalidInputError
from sain_core.push import idle_pushes, make_push
from sain_model.network import corrections as told
from sain_model.physics.parameters import BY_NAME, check_values
from sain_model.physics.planar_config import PlanarConfig


def test_corrections_saturate_where_they_would_be_no_physics() -> None:
    huge = np.random.default_rng(0).choice([-1e3, 1e3], (30, 2, told.CORRECTIONS))
    assert (np.abs(told.saturated(huge)) <= told.MOST).all()
    values = told.corrected_values(huge, idle_pushes(30), PlanarConfig())
    assert len(values) == told.CORRECTIONS and values.keys() <= BY_NAME.keys()
    check_values(values, 30, 2)


def test_no_correction_is_the_prior() -> None:
    none = np.zeros((3, 2, told.CORRECTIONS))
    values = told.corrected_values(none, idle_pushes(3), PlanarConfig())
    for name, value in values.items():
        np.testing.assert_array_equal(value, getattr(PlanarConfig(), name))


def test_the_tool_is_that_of_the_pushed_body() -> None:
    corrections = np.zeros((2, 2, told.CORRECTIONS))
    corrections[:, 1, told.LENGTH] = 1.0
    pushes = make_push(0.0, 0.0, 0.1, body=np.arange(2))
    first, second = told.corrected_values(corrections, pushes, PlanarConfig())["length_offset"]
    assert first == 0.0 and second == pytest.approx(0.005, rel=0.05)


def test_what_is_not_finite_is_refused() -> None:
    corrections = np.zeros((3, 2, told.CORRECTIONS))
    corrections[1, 0, 4] = np.nan
    with pytest.raises(InvalidInputError, match=r"corrections\[1, 0, 4\] is nan"):
        told.corrected_values(corrections, idle_pushes(3), PlanarConfig())
