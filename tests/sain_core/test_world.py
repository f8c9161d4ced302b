"""What may be said of a camera."""

import pytest

from sain_core.errors import ConfigError
from sain_core.world import ObservationConfig, observation_settings


def test_observations_are_exact_unless_it_is_said_otherwise():
    assert ObservationConfig().is_exact
    for said in ({"noise": "0.005,0"}, {"bias": "0,0.1"}, {"delay": 0.1}, {"unknown": "mass"}):
        assert not ObservationConfig(**said).is_exact


def test_the_numbers_are_read():
    config = ObservationConfig(noise="0.005,0.035", unknown=" mass, mass")
    assert config.noise_std == (0.005, 0.035)
    assert config.unknown_names == ("mass",)
    assert ObservationConfig(**observation_settings(config)) == config


@pytest.mark.parametrize(
    ("said", "wrong", "allowed"),
    [
        ({"noise": "-0.005,0"}, "-0.005 m", "0 to 0.02 m"),
        ({"noise": "0.1,0"}, "0.1 m", "0 to 0.02 m"),
        ({"bias": "0,1"}, "1 rad", "0 to 0.35 rad"),
        ({"noise": "nan,0"}, "nan m", "0 to 0.02 m"),
        ({"noise": "0.005"}, "'0.005'", "two numbers with a comma"),
        ({"noise": "much"}, "'much'", "two numbers with a comma"),
        ({"delay": 2.0}, "2.0 s", "at most 0.5 s"),
        ({"delay": -0.1}, "-0.1 s", "at least 0 s"),
        ({"unknown": "mass,radius"}, "'mass,radius'", "allowed: mass"),
    ],
)
def test_what_cannot_be_is_refused_with_what_is_allowed(said, wrong, allowed):
    with pytest.raises(ConfigError) as error:
        ObservationConfig(**said)
    assert wrong in str(error.value)
    assert allowed in str(error.value)
