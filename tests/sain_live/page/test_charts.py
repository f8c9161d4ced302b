"""The charts, as numbers."""

import numpy as np
import pytest

from sain_live.page.charts import columns, scales


def test_a_chart_begins_before_the_first_push():
    pushes, distance = columns((107.0, 70.0, 6.0))
    assert pushes.tolist() == [0.0, 1.0, 2.0]
    assert distance.tolist() == [107.0, 70.0, 6.0]


def test_a_chart_without_a_push_has_two_ticks():
    pushes, *curves = columns((), ())
    assert pushes.tolist() == [0.0, 1.0]
    assert np.isnan(curves).all()


def test_a_curve_that_is_not_known_so_far_ends_earlier():
    pushes, planned, physics = columns((np.nan, 1.0, 2.0), (np.nan, 3.0))
    assert pushes.tolist() == [0.0, 1.0, 2.0]
    assert planned[1:].tolist() == [1.0, 2.0]
    assert physics[1] == 3.0
    assert np.isnan(physics[2])


@pytest.mark.parametrize(
    ("curves", "largest"), [(((np.nan, 5.0), (2.0,)), 5.0), (((np.nan,),), 0.0), (((),), 0.0)]
)
def test_a_scale_holds_all_that_is_known(curves, largest):
    low, high = scales(*curves)["y"]["range"]
    assert low == 0.0
    assert largest < high <= max(1.0, 1.2 * largest)
