"""Resets that viewers ask for, and the settings that they can change."""

import dataclasses

import pytest

from sain_core.config import Config
from sain_core.errors import ConfigError
from sain_live.orders import Reset, planner_settings
from sain_mppi.config import PlannerConfig


def test_a_reset_is_the_scene_of_the_scenario():
    case = Reset("push_t", 3).case()
    assert (case.scenario, case.seed, case.shapes) == ("push_t", 3, ("t",))


@pytest.mark.parametrize("scenario", ["push_t", "rearrange_2", "streak"])
def test_the_shape_is_free_where_the_scenario_says_so(scenario):
    assert set(Reset(scenario, 0, "box_3x2").case().shapes) == {"box_3x2"}
    assert Reset("anywhere", 0, "cube").case().shapes == ("disk", "cube")


def test_what_cannot_be_is_refused_in_words():
    with pytest.raises(ConfigError, match="have shapes of their own"):
        Reset("blocked", 0, "t").case()
    with pytest.raises(ConfigError, match="scenario 'none' is unknown; known: anywhere"):
        Reset("none", 0).case()


def numbers_of_settings(config):
    values = [getattr(config, item.name) for item in dataclasses.fields(config)]
    return sum(numbers_of_settings(v) if isinstance(v, Config) else 1 for v in values)


def test_every_setting_of_the_planner_is_offered():
    names = [name for _, name, _, _ in planner_settings()]
    assert len(set(names)) == len(names) == numbers_of_settings(PlannerConfig())
    assert {"planner.samples", "planner.weights.distance", "planner.noise.angle"} <= set(names)
