"""What viewers ask for: resets, settings, and goals, which are checked before they are sent."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from sain_core.config import Config
from sain_core.errors import ConfigError, InvalidInputError, OffTableError, UnreachableError
from sain_core.goal import Goal
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies
from sain_live.orders import Reset, check_aim, first_aim, planner_settings
from sain_mppi.config import PlannerConfig
from tests.sain_live.straw import AIM, BODIES, SCENE


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


PAIR = make_scene(np.array([(0.45, 0.0), (0.6, 0.0)]), np.ones(2), np.array([0.08, 0.06]))
DISKS = Bodies.disks(2)


def test_a_goal_on_the_table_is_fine():
    check_aim(AIM, SCENE, BODIES)
    check_aim(Goal.place(0.6, 0.1), PAIR, DISKS)


@pytest.mark.parametrize("place", [(2.0, 0.0), (0.5, 0.9), (0.0, 0.0)])
def test_off_the_table_is_refused_in_words(place):
    with pytest.raises(OffTableError, match=r"off the table.*it covers x in"):
        check_aim(AIM.with_pose(0, *place, 0.0), SCENE, BODIES)
    with pytest.raises(OffTableError, match="off the table"):
        check_aim(Goal.place(*place), PAIR, DISKS)


def test_out_of_reach_is_refused_in_words():
    with pytest.raises(UnreachableError, match="out of reach"):
        check_aim(Goal.place(1.1, 0.5), PAIR, DISKS)


@pytest.mark.parametrize("role", ["fixed", "movable"])
def test_into_a_body_that_stays_is_refused_in_words(role):
    bodies = Bodies.named(["t", "disk"], ["pushable", role])
    with pytest.raises(InvalidInputError, match=r"goal of body 0 .*body 1"):
        check_aim(AIM.with_pose(0, 0.6, -0.2, 0.0), SCENE, bodies)


def test_into_a_body_that_can_be_pushed_away_is_fine():
    bodies = Bodies.named(["t", "disk"], ["pushable", "pushable"])
    check_aim(AIM.with_pose(0, 0.6, -0.2, 0.0), SCENE, bodies)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_what_is_not_finite_is_refused(value):
    with pytest.raises(InvalidInputError, match="finite"):
        check_aim(AIM.with_pose(0, value, 0.0, 0.0), SCENE, BODIES)


def test_a_moved_goal_keeps_the_rest():
    moved = AIM.with_pose(0, 0.4, 0.1, 1.0).poses[0]
    assert moved == replace(AIM.poses[0], x=0.4, y=0.1, heading=1.0)
    place = Goal.place(0.5, 0.0, 0.01).with_pose(1, 0.6, 0.1, 2.0)
    assert (place.poses[0].heading, place.tolerance) == (None, 0.01)
    assert place.places.tolist() == [[0.6, 0.1]]


def test_the_first_goal_can_be_served():
    for scene, bodies in ((SCENE, BODIES), (PAIR, DISKS)):
        aim = first_aim(scene, bodies)
        check_aim(aim, scene, bodies)
    alone = first_aim(PAIR[:1], Bodies.disks(1))
    assert alone is not None and [pose.body for pose in alone.poses] == [0]
