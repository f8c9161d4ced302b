import numpy as np
import pytest

from sain_core.errors import ConfigError
from sain_core.randomness import generator
from sain_core.shapes.library import get_shape
from sain_sim.engines.bullet_bodies import Body, resting
from sain_sim.engines.bullet_client import Client
from sain_sim.world.parameters import (
    FRICTION_RANGE,
    MASS_RANGE,
    RADIUS_RANGES,
    WorldParameters,
    nominal_parameters,
    sample_parameters,
)
from tests.hexagon import SOME


def test_the_nominal_world_is_the_papers():
    nominal = nominal_parameters(3)
    assert nominal.masses == (8.0, 8.0, 8.0)
    assert nominal.radii == (0.08, 0.06, 0.06)
    assert nominal.friction == 0.12


def test_drawn_parameters_fill_the_papers_ranges_and_repeat():
    drawn = [sample_parameters(generator(5, i), 3) for i in range(300)]
    assert drawn == [sample_parameters(generator(5, i), 3) for i in range(300)]
    columns = [
        (np.array([d.masses for d in drawn]), MASS_RANGE),
        (np.array([d.radii[0] for d in drawn]), RADIUS_RANGES[0]),
        (np.array([d.radii[1:] for d in drawn]), RADIUS_RANGES[1]),
        (np.array([d.friction for d in drawn]), FRICTION_RANGE),
    ]
    for values, (low, high) in columns:
        assert values.min() >= low and values.max() <= high
        assert values.min() < low + 0.05 * (high - low)
        assert values.max() > high - 0.05 * (high - low)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"masses": (8.0,)}, "1 masses, 2 radii and 2 shapes"),
        ({"shapes": ("disk", "cone")}, "shape of body 1 is 'cone'"),
        ({"friction": -0.1}, "friction is -0.1; it must be at least 0.005"),
        ({"radii": (0.08, float("nan"))}, "radii[1] is nan; it must be finite"),
    ],
)
def test_parameters_that_make_no_world_are_refused(fields, message):
    with pytest.raises(ConfigError) as caught:
        WorldParameters(**fields)
    assert message in str(caught.value)


@pytest.mark.parametrize("name", SOME)
def test_bullet_knows_the_mass_and_inertia_of_a_uniform_body(name):
    client, shape = Client(), get_shape(name)
    parameters = WorldParameters(masses=(7.5,), radii=(0.08,), shapes=(name,))
    scene = parameters.scene(np.array([[0.4, 0.0]]))
    body = Body(client, parameters, 0, resting(client, scene[0]), 0.3)
    told = client.getDynamicsInfo(body.id, -1)
    assert told[0] == 7.5
    assert np.allclose(told[2], shape.inertia(7.5, 0.08))
    client.close()
