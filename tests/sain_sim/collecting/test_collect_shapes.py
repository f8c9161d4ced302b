"""Collections of bodies of any shape: columns, pushes along outlines, and the same bytes again."""

import numpy as np
import pytest
from shapely import Polygon

from sain_core.errors import ConfigError, InvalidInputError
from sain_core.push import BODY, LENGTH, LOCATION, PUSH_SIZE, PushLimits, pushed_bodies, strokes
from sain_core.randomness import generator
from sain_core.scene import POSITION, RADIUS, make_scene
from sain_core.shapes.bodies import Bodies, Role
from sain_core.transitions import Column, row_bodies
from sain_sim.collecting.collect import CollectConfig, collect
from sain_sim.collecting.episode import (
    EpisodeConfig,
    draw_aimed_push,
    draw_outline_push,
    draw_parameters,
)
from sain_sim.collecting.shards import load_by_count
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.start import draw_bodies_start
from sain_sim.world.truth import TruthConfig
from sain_sim.world.workcell import WorldConfig

MANY = EpisodeConfig(pushes=3, shapes="t, l,disk", bodies="1-3")


@pytest.fixture(scope="module")
def collected(tmp_path_factory):
    folder = tmp_path_factory.mktemp("shapes")
    collect(CollectConfig(folder, 8, 3, episode=MANY))
    return folder


def test_rows_state_shapes_roles_and_the_body_of_the_push(collected):
    found = load_by_count(collected)
    assert len(found) > 1
    assert set(found) <= {1, 2, 3}
    pushed = []
    for count, data in found.items():
        assert data[Column.ACTION].shape[1] == PUSH_SIZE
        assert (pushed_bodies(data[Column.ACTION]) < count).all()
        pushed += pushed_bodies(data[Column.ACTION]).tolist()
        for bodies in row_bodies(data):
            assert len(bodies) == count
            assert {shape.name for shape in bodies.shapes} <= {"t", "l", "disk"}
            assert set(bodies.roles) == {Role.PUSHABLE}
    assert len(set(pushed)) > 1


def test_a_push_moves_the_body_that_it_names_and_physics_predicts_it(collected):
    for count, data in load_by_count(collected).items():
        rows = np.arange(len(data[Column.ACTION]))
        before, after, physics = (
            data[name].reshape(-1, count, 8)
            for name in (Column.STATE, Column.NEXT_STATE, Column.PHYSICS_NEXT)
        )
        body = pushed_bodies(data[Column.ACTION])
        moved = np.hypot(*(after - before)[rows, body, :2].T)
        travel = data[Column.ACTION][:, LENGTH]
        assert (moved[travel > 0.08] > 0.001).all()
        error = np.hypot(*(physics - after)[rows, body, :2].T)
        assert np.median(error) < 0.5 * np.median(moved)


def test_pushes_are_even_along_the_outlines_of_all_pushable_bodies():
    bodies = Bodies.named(["bar", "disk", "t"], ["pushable", "fixed", "pushable"])
    scene = make_scene(np.zeros((3, 2)), np.ones(3), np.array([0.08, 0.06, 0.04]))
    random = np.random.default_rng(0)
    drawn = np.array([draw_outline_push(random, scene, bodies) for _ in range(2000)])
    assert set(drawn[:, BODY]) == {0.0, 2.0}
    assert abs(np.histogram(drawn[:, LOCATION], 8, (-np.pi, np.pi))[0] / 250 - 1).max() < 0.25
    start, _ = strokes(np.broadcast_to(scene, (2000, 3, 8)), drawn, PushLimits(), bodies)
    away = np.hypot(*start.T)
    assert (away < scene[pushed_bodies(drawn), RADIUS] + 0.018).all()


def test_half_of_the_bodies_touch_and_most_pushes_go_to_another_one():
    table, touching, aimed = WorldConfig().feasibility.table, 0, 0
    for seed in range(60):
        random = generator(seed, "start")
        parameters = nominal_parameters(3, ("l", "t", "star"))
        scene = draw_bodies_start(random, parameters, table)
        one, two, three = (
            Polygon(shape.placed(state))
            for shape, state in zip(parameters.body_shapes, scene, strict=True)
        )
        gaps = [one.distance(two), min(three.distance(one), three.distance(two))]
        assert min(gaps) > 0.0 and max(gaps) < 0.061
        touching += sum(gap <= 0.002 for gap in gaps)
        for _ in range(10):
            push = draw_aimed_push(random, scene, parameters.bodies)
            body = int(pushed_bodies(push))
            ways = np.delete(scene[:, POSITION], body, axis=0) - scene[body, POSITION]
            x, y = ways[np.hypot(*ways.T).argmin()]
            heading = strokes(scene, push, PushLimits(), parameters.bodies)[1]
            aimed += np.cos(heading - np.arctan2(y, x)) > np.cos(0.6)
    assert 40 < touching < 85
    assert 360 < aimed < 480  # 0.6 of 600, and by chance a fifth of the others


def test_each_episode_is_in_a_laboratory_of_its_own():
    config = EpisodeConfig(labs=1000, truth=TruthConfig("rough", lab=7), shapes="t", bodies="1")
    drawn = [draw_parameters(generator(3, "episode", number), config) for number in range(8)]
    assert len({one.roughness for one in drawn}) == len({one.friction for one in drawn}) == 8
    again = draw_parameters(generator(3, "episode", 2), config)
    assert again == drawn[2]


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"shapes": "t,blob"}, "shape is 'blob'"),
        ({"shapes": "t", "bodies": "0"}, "bodies is '0'; give a number from 1 to 32"),
        ({"shapes": "t", "bodies": "3-1"}, "bodies is '3-1'"),
        ({"shapes": "t", "bodies": "1-999999999999"}, "bodies is '1-999999999999'"),
        ({"shapes": "t", "bodies": "many"}, "bodies is 'many'"),
        ({"bodies": "2"}, "bodies is '2', and shapes is empty"),
        ({"speeds": "0.2-0.1"}, "speeds is '0.2-0.1'; give a speed from 0.01 to 0.5 m/s"),
        ({"speeds": "0"}, "speeds is '0'"),
        ({"speeds": "slow"}, "speeds is 'slow'"),
        ({"labs": 5}, "labs is 5, and world randomised is none; use world rough or measured"),
    ],
)
def test_settings_that_cannot_be_are_refused(settings, text):
    with pytest.raises((ConfigError, InvalidInputError)) as raised:
        EpisodeConfig(**settings)
    assert text in str(raised.value)
