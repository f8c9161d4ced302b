"""Strokes: pushes that state themselves where the tool goes."""

from math import pi

import numpy as np
import pytest

from sain_core.errors import InvalidInputError, OutOfRangeError
from sain_core.feasibility import start_gap
from sain_core.push import (
    ANGLE,
    BODY,
    LENGTH,
    SPEED,
    START,
    TIP_RADIUS,
    PushLimits,
    as_strokes,
    make_stroke,
)
from sain_core.scene import POSITION, THETA, make_scene, unit, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import get_shape
from sain_core.types import Pushes, Scenes
from sain_model.network.features import network_inputs, push_frames
from sain_model.network.settings import NetworkConfig
from sain_model.physics.parameters import PlanarConfig
from sain_model.physics.planar import PlanarPrior, first_touch
from tests.strokes import rotate_pushes, rotate_scenes

LIMITS = PushLimits()
TIP = 0.00475


def bodies_of(*names: str) -> Bodies:
    return Bodies(tuple(map(get_shape, names)))


def draw(count: int, batch: int, seed: int = 0) -> tuple[Scenes, Pushes]:
    """Draw scenes of bodies that stand apart, and pushes of body 0."""
    random = np.random.default_rng(seed)
    places = np.array([(0.45, 0.0), (0.62, 0.03)])[:count]
    heading = random.uniform(-3, 3, (batch, count))
    scenes = np.stack(
        [make_scene(places, np.full(count, 2.0), np.full(count, 0.06), some) for some in heading]
    )
    return scenes, LIMITS.sample(random, batch)


def draw_strokes(scenes: Scenes, seed: int = 0) -> Pushes:
    """Draw strokes from a ring about body 0, steep ones and misses among them."""
    random = np.random.default_rng(seed)
    batch = len(scenes)
    bearing = random.uniform(-pi, pi, batch)
    start = scenes[:, 0, POSITION] + 0.085 * unit(bearing)
    heading = bearing + pi + random.uniform(-1.2, 1.2, batch)
    return make_stroke(start, heading, 0.06, speed=0.02, tip_radius=TIP)


@pytest.mark.parametrize(
    ("names", "radius"), [(("disk", "disk"), 0.012), (("t", "disk"), 0.004), (("star",), 0.03)]
)
def test_a_push_is_predicted_as_the_stroke_that_it_is_of_its_own_tool(names, radius):
    bodies, limits = bodies_of(*names), PushLimits(tool_radius=radius)
    scenes, pushes = draw(len(names), 60)
    free = start_gap(scenes, pushes, limits, bodies) > 0.0  # not in an inner corner
    scenes, pushes = scenes[free], pushes[free]
    expected = PlanarPrior(PlanarConfig(tool_radius=radius), bodies).step(scenes, pushes)
    strokes = as_strokes(scenes, pushes, limits, bodies)
    assert (strokes[:, TIP_RADIUS] == radius).all()
    predicted = PlanarPrior().with_bodies(bodies).step(scenes, strokes)
    np.testing.assert_allclose(predicted, expected, atol=1e-9)
    assert np.abs(expected - scenes)[..., POSITION].max() > 0.02


@pytest.mark.parametrize("names", [("disk", "disk"), ("t", "disk"), ("ellipse",)])
def test_a_turned_stroke_ends_turned_and_looks_the_same(names):
    bodies = bodies_of(*names)
    scenes, _ = draw(len(names), 60)
    strokes = draw_strokes(scenes)
    prior = PlanarPrior().with_bodies(bodies)
    after = prior.step(scenes, strokes)
    turned_scenes, turned = rotate_scenes(scenes, 0.7), rotate_pushes(strokes, 0.7)
    away = prior.step(turned_scenes, turned) - rotate_scenes(after, 0.7)
    away[..., THETA] = wrap_angle(away[..., THETA])
    assert np.abs(away).max() < 1e-4
    looks, turned_looks = (
        network_inputs(NetworkConfig(), at, push_frames(at, push, bodies), moved, bodies)
        for at, push, moved in (
            (scenes, strokes, after),
            (turned_scenes, turned, rotate_scenes(after, 0.7)),
        )
    )
    np.testing.assert_allclose(turned_looks.bodies, looks.bodies, atol=2e-4)
    np.testing.assert_allclose(turned_looks.relations, looks.relations, atol=2e-4)


def test_the_frame_is_where_the_tool_first_touches():
    """A cube of 0.12 m, its sides along the axes: against a side, a corner, and past it."""
    scene = make_scene(np.array([(0.5, 0.0)]), np.ones(1), np.array([0.06]), np.zeros(1))
    scenes = np.broadcast_to(scene, (4, 1, 8))
    start = np.array([(0.42, 0.02), (0.42, 0.06 + TIP / 2), (0.42, 0.07), (0.42, 0.0)])
    strokes = make_stroke(start, [0.3, 0.0, 0.0, 0.0], [0.05, 0.05, 0.05, 0.01], tip_radius=TIP)
    touch = first_touch(scenes, strokes, bodies_of("cube"))
    up = -np.arcsin(0.5)  # the axis is half a radius above the corner
    np.testing.assert_allclose(touch.normal, [0.0, up, 0.0, 0.0], atol=1e-12)
    reach = [(0.02 - TIP) / np.cos(0.3), 0.02 - TIP * np.cos(up), np.inf, np.inf]
    np.testing.assert_allclose(touch.distance, reach)
    np.testing.assert_allclose(touch.gap[[0, 3]], 0.02 - TIP)
    frames = push_frames(scenes, strokes, bodies_of("cube"))
    np.testing.assert_allclose(frames[:, ANGLE], [0.3, -up, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("centre", [(0.3, 0.0), (-0.2, 0.2)])
def test_a_disk_with_its_mass_off_the_middle_is_pushed_at_its_rim(centre):
    bodies = bodies_of("disk", "disk")
    place = np.array([(0.45, 0.0), (0.575, 0.01)])
    scenes = make_scene(place, np.full(2, 2.0), np.full(2, 0.06), np.array([0.4, -2.0]))[None]
    start = np.array([(0.37, 0.005)])
    stroke = make_stroke(start, 0.0, 0.06, speed=0.02, tip_radius=TIP)
    config = PlanarConfig(centre_x=centre[0], centre_y=centre[1])
    after = PlanarPrior(config, bodies).step(scenes, stroke)
    tool = np.linalg.norm(after[0, 0, POSITION] - (start[0] + (0.06, 0.0)))
    assert abs(tool - 0.06 - TIP) < 1e-4
    between = np.linalg.norm(after[0, 0, POSITION] - after[0, 1, POSITION])
    assert abs(between - 0.12) < 1e-4 and after[0, 1, 0] > 0.6


@pytest.mark.parametrize("name", ["disk", "l"])
def test_a_tool_that_begins_inside_a_body_is_refused(name):
    bodies = bodies_of(name, "disk")
    scenes, _ = draw(2, 3)
    strokes = draw_strokes(scenes)
    strokes[1, START] = scenes[1, 1, POSITION] - (0.06, 0.0)
    with pytest.raises(
        InvalidInputError, match=r"stroke 1 begins with the tool 4\.75 mm inside body 1; it must"
    ):
        PlanarPrior().with_bodies(bodies).step(scenes, strokes)
    strokes[1, LENGTH] = 0.0
    PlanarPrior().with_bodies(bodies).step(scenes, strokes)  # it does not move


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        (SPEED, 0.0009, r"speed of push \(2,\) is 0.0009; allowed: 0.001 to 2"),
        (SPEED, 2.1, "speed of push"),
        (LENGTH, 0.51, r"length of push \(2,\) is 0.51; allowed: 0 to 0.5"),
        (TIP_RADIUS, 0.0, r"tip_radius of push \(2,\) is 0.0; allowed: 0.001 to 0.05"),
        (LENGTH, np.nan, r"length of push \(2,\) is nan; it must be finite"),
        (TIP_RADIUS, np.inf, r"tip_radius of push \(2,\) is inf"),
        (BODY, 1.0, "push 2 is against body 1"),
    ],
)
def test_a_stroke_that_cannot_be_is_refused(column, value, message):
    scenes, _ = draw(1, 4)
    strokes = draw_strokes(scenes)
    strokes[2, column] = value
    with pytest.raises((InvalidInputError, OutOfRangeError), match=message):
        PlanarPrior().with_bodies(bodies_of("t")).step(scenes, strokes)
