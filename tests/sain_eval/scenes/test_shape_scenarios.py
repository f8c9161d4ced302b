"""Scenes of bodies of any shape: valid by construction, from their seed alone, not yet solved."""

from itertools import combinations

import numpy as np
import pytest

from sain_core.feasibility import Feasibility
from sain_core.scene import POSITION, RADIUS, TARGET
from sain_core.shapes.bodies import Bodies, check_bodies
from sain_core.shapes.shape import is_inside
from sain_eval.scenes.families import PoseScenario
from sain_eval.scenes.placement import has_tool_room
from sain_eval.scenes.scenarios import SCENARIOS

FEASIBILITY = Feasibility()
POSES = ("box", "push_t", "shapes", "rearrange_2", "rearrange_3", "rearrange_4")
SEEDS = range(40)


def bodies_of(case) -> Bodies:
    return case.parameters().bodies


def sizes_of(case) -> np.ndarray:
    return case.disks[:, RADIUS] * [shape.circumradius for shape in bodies_of(case).shapes]


def gaps(places, sizes) -> list[float]:
    """Return the gaps between circumscribed circles."""
    return [
        float(np.linalg.norm(places[a] - places[b]) - sizes[a] - sizes[b])
        for a, b in combinations(range(len(places)), 2)
    ]


@pytest.mark.parametrize("name", POSES)
def test_bodies_and_poses_are_on_the_table_apart_and_with_room_for_the_tool(name):
    for seed in SEEDS:
        case = SCENARIOS[name].scene(seed)
        bodies, sizes = bodies_of(case), sizes_of(case)
        check_bodies(case.disks, bodies, FEASIBILITY.table)
        case.goal.check(case.disks, bodies, FEASIBILITY.table)
        ends = case.goal.placed(case.disks)
        for scene in (case.disks, ends):
            assert has_tool_room(scene[:, POSITION], sizes).all()
            assert min(gaps(scene[:, POSITION], sizes), default=1.0) >= 0.03
        way = np.linalg.norm((ends - case.disks)[:, POSITION], axis=1)
        assert way.min() >= 0.08
        assert not case.goal.judge(case.disks, case.disks, bodies).reached


def test_body_0_alone_may_be_touched_where_it_pushes_another():
    for seed in SEEDS:
        case = SCENARIOS["shapes_indirect"].scene(seed)
        bodies = bodies_of(case)
        assert bodies.pushable == (0,) and case.shapes[0] != case.shapes[1]
        check_bodies(case.disks, bodies, FEASIBILITY.table)
        assert has_tool_room(case.disks[:, POSITION], sizes_of(case)).all()
        away = np.linalg.norm(case.goal.places[0] - case.disks[TARGET, POSITION])
        assert 0.15 <= away <= 0.30


def test_what_blocks_the_way_stands_in_the_straight_lane_and_may_be_touched():
    counts = set()
    for seed in SEEDS:
        case = SCENARIOS["blocked"].scene(seed)
        bodies = bodies_of(case)
        check_bodies(case.disks, bodies, FEASIBILITY.table)
        assert bodies.pushable == (0, *range(2, len(bodies)))
        counts.add(len(bodies))
        target, goal, sizes = case.disks[TARGET, POSITION], case.goal.places[0], sizes_of(case)
        way = (goal - target) / np.linalg.norm(goal - target)
        side = sizes[TARGET] * np.array([-way[1], way[0]])
        for body in range(2, len(bodies)):
            place = case.disks[body, POSITION]
            widest = side * (1.0 + 0.5 * sizes[body] / sizes[TARGET])
            lane = np.stack([target - widest, goal - widest, goal + widest, target + widest])
            assert is_inside(place, lane)
            assert has_tool_room(place, sizes[body])
    assert counts == {3, 4}


def test_a_streak_is_many_poses_each_away_from_the_one_before():
    case = SCENARIOS["streak"].scene(0)
    assert len(case.goals) == 100 and case.shapes == ("t",)
    places = [case.disks[0, POSITION]]
    places += [np.array([goal.poses[0].x, goal.poses[0].y]) for goal in case.goals]
    ways = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert ways.min() >= 0.08
    assert has_tool_room(np.stack(places), sizes_of(case)[0]).all()
    assert len(PoseScenario("streak", "t", goals=3).scene(0).goals) == 3
