"""What viewers ask for: resets, settings, and goals, which are checked before they are sent."""

import numpy as np
import pytest

from sain_core.errors import ConfigError, InvalidInputError, OffTableError
from sain_core.goal import Goal
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies
from sain_live.goals import check_goal
from sain_live.requests import Reset
from sain_live.settings import PageConfig
from tests.sain_core.shapes.test_outlines import a_bar, objects
from tests.sain_live.straw import AIM, BODIES, SCENE


def test_a_reset_is_the_scene_of_the_scenario():
    case = Reset.draw("push_t", 3).case
    assert (case.scenario, case.seed, case.shapes) == ("push_t", 3, ("t",))


def test_a_reset_has_bodies_of_a_file(tmp_path):
    file = objects(tmp_path, a_bar(name="Can", height_m=0.06))
    config = PageConfig(scenario="anything:can", outlines=str(file))
    case = Reset.draw(config.scenario, 3, outlines=config.outlines_file).case
    assert (case.scenario, case.heights) == ("anything:can", (0.06,))


def test_what_cannot_be_is_refused_in_words():
    with pytest.raises(ConfigError, match="have shapes of their own"):
        Reset.draw("blocked", 0, "t")
    with pytest.raises(ConfigError, match="scenario 'none' is unknown; known: anywhere"):
        Reset.draw("none", 0)


PAIR = make_scene(np.array([(0.45, 0.0), (0.6, 0.0)]), np.ones(2), np.array([0.08, 0.06]))
DISKS = Bodies.disks(2)


@pytest.mark.parametrize("place", [(2.0, 0.0), (0.5, 0.9), (0.0, 0.0)])
def test_off_the_table_is_refused_in_words(place):
    with pytest.raises(OffTableError, match=r"off the table.*it covers x in"):
        check_goal(AIM.with_pose(0, *place, 0.0), SCENE, BODIES)
    with pytest.raises(OffTableError, match="off the table"):
        check_goal(Goal.place(*place), PAIR, DISKS)


@pytest.mark.parametrize("role", ["fixed", "movable"])
def test_into_a_body_that_stays_is_refused_in_words(role):
    bodies = Bodies.named(["t", "disk"], ["pushable", role])
    with pytest.raises(InvalidInputError, match=r"goal of body 0 .*body 1"):
        check_goal(AIM.with_pose(0, 0.6, -0.2, 0.0), SCENE, bodies)
