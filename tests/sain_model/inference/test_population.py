"""What bodies on surfaces show of one another."""

from dataclasses import replace

import numpy as np
import pytest

from sain_model.inference.kinds import surface_kind
from sain_model.inference.population import PARTS, Pair, Population, Shown

KIND = surface_kind()
NAMES = list(KIND.names)
PRESSURE, TIP = NAMES.index("pressure"), NAMES.index("tip_x")


def shown(**values):
    """Return what many pushes of a body with these values would show."""
    place = np.array([values.get(name, 0.0) for name in NAMES])
    information = 400.0 * np.eye(len(NAMES))
    return Shown(place, information, information @ place)


def test_before_any_push_the_textbook_is_believed():
    mean, covariance = Population.before(KIND).belief(Pair("a", "b"))
    np.testing.assert_array_equal(mean, 0.0)
    assert not Population.of(KIND, {}).shown
    np.testing.assert_allclose(covariance, KIND.covariance, atol=1e-12)
    assert all(sum(shares) == pytest.approx(1.0) for shares in PARTS.values())


def test_a_body_brings_its_pressure_to_another_surface_and_a_surface_its_tool():
    population = replace(
        Population.before(KIND),
        shown={
            Pair("square", "steel"): shown(pressure=2.0, tip_x=1.0),
            Pair("disk", "steel"): shown(pressure=-1.0, tip_x=1.0),
            Pair("disk", "wood"): shown(pressure=-1.0, tip_x=0.0),
        },
    )
    same_body = population.place(Pair("square", "wood"))
    assert 1.0 < same_body[PRESSURE] < 2.0
    new_on_steel, new_on_wood = (population.place(Pair("new", on)) for on in ("steel", "wood"))
    assert new_on_steel[TIP] > new_on_wood[TIP] + 0.1
    assert abs(new_on_steel[PRESSURE]) < 1.0
    for pair, one in population.shown.items():
        own, spread = population.belief(pair, own=True)
        np.testing.assert_allclose(own, one.place, atol=0.02)
        assert np.all(np.diag(spread) < np.diag(population.belief(pair)[1]))


def test_the_order_of_the_pairs_does_not_count():
    random = np.random.default_rng(0)
    pairs = [Pair(body, surface) for body in "abcd" for surface in ("steel", "wood")]
    each = {pair: shown(pressure=random.normal(), torsion=random.normal()) for pair in pairs}
    turned = dict(reversed(each.items()))
    one, other = (
        replace(Population.before(KIND), shown=some).learned().belief(Pair("e", "wood"))
        for some in (each, turned)
    )
    np.testing.assert_allclose(one[0], other[0], atol=1e-9)
    np.testing.assert_allclose(one[1], other[1], atol=1e-9)


def test_bodies_that_differ_widen_the_belief_of_another():
    def believed(scale):
        pairs = {
            Pair(str(number), surface): shown(pressure=scale * (number - 4.5))
            for number in range(10)
            for surface in ("steel", "wood")
        }
        population = replace(Population.before(KIND), shown=pairs).learned()
        return population.belief(Pair("new", "wood"))[1][PRESSURE, PRESSURE]

    assert believed(1.0) > 4.0 > 1.0 > believed(0.05)
