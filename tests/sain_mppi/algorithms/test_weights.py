"""Laws of the softmin weights, and of means with them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sain_core.push import make_push
from sain_mppi.algorithms.sampling import effective_samples, softmin_weights, weighted_mean

COSTS = st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=40).map(np.array)


@given(COSTS, st.floats(1e-6, 1e3))
def test_weights_sum_to_one_and_order_as_costs_do(costs, temperature):
    weights = softmin_weights(costs, temperature)
    assert weights.sum() == pytest.approx(1.0)
    assert (np.diff(weights[np.argsort(costs)]) <= 1e-12).all()


@given(COSTS, st.floats(-1e3, 1e3))
def test_a_constant_on_all_costs_changes_nothing(costs, constant):
    before, after = softmin_weights(costs, 1.0), softmin_weights(costs + constant, 1.0)
    np.testing.assert_allclose(before, after, atol=1e-9)


@pytest.mark.parametrize("temperature", [0.0, 1e-12])
def test_temperature_to_zero_picks_the_cheapest(temperature):
    weights = softmin_weights(np.array([3.0, 1.0, 2.0, np.inf]), temperature)
    np.testing.assert_array_equal(weights, [0.0, 1.0, 0.0, 0.0])


@given(COSTS)
def test_effective_samples_lie_between_one_and_the_count(costs):
    count = effective_samples(softmin_weights(costs, 1.0))
    assert 1.0 - 1e-9 <= count <= len(costs) + 1e-9


def test_the_mean_of_locations_is_taken_on_the_circle():
    sequences = make_push([[3.0], [-3.0]], [[0.1], [0.3]], [[0.05], [0.15]])
    mean = weighted_mean(sequences, np.array([0.5, 0.5]))
    np.testing.assert_allclose(mean, make_push(np.pi, 0.2, 0.1)[None])
