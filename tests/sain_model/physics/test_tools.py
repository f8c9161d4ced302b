"""Tools of two disks: two fingers, and a bar with one at each end."""

from math import pi

import numpy as np
import pytest

from sain_core.errors import InvalidInputError, OutOfRangeError
from sain_core.push import (
    LENGTH,
    LOCATION,
    SPAN,
    START,
    STROKE_SIZE,
    PushLimits,
    as_strokes,
    make_stroke,
    mirror_pushes,
)
from sain_core.scene import POSITION, THETA, make_scene, mirror_scenes, unit, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import get_shape
from sain_core.shapes.shape import FLAT
from sain_core.types import Pushes, Scenes
from sain_model.network.features import network_inputs, push_frames
from sain_model.network.settings import NetworkConfig
from sain_model.physics.parameters import PlanarConfig
from sain_model.physics.planar import PlanarPrior, first_touch
from tests.strokes import rotate_pushes, rotate_scenes

TIP = 0.005
HALF = 0.06  # [m], of a side of the square
OFF_CENTRE = PlanarConfig(centre_y=0.3)
SLOW, FAST = 0.02, 0.2  # [m/s], in balance at all times, and with inertia


def bodies_of(name: str) -> Bodies:
    return Bodies((get_shape(name).on(FLAT),))


SQUARE = bodies_of("cube")


def square(heading: float = 0.0) -> Scenes:
    place = np.array([(0.5, 0.0)])
    return make_scene(place, np.ones(1), np.array([HALF]), np.array([heading]))[None]


def tool(first: float, second: float | None = None, *, bar: bool = False, speed: float = SLOW):
    """Return a stroke along x, of a tool with disks at these y [m]."""
    span = np.zeros((1, 2)) if second is None else np.array([[0.0, second - first]])
    start = np.array([[0.42, first]])
    return make_stroke(start, 0.0, 0.06, speed=speed, tip_radius=TIP, span=span, bar=bar)


def draw(name: str, count: int = 200) -> tuple[Scenes, Pushes]:
    """Draw strokes of fingers and bars, from all around, that begin outside of a body."""
    random = np.random.default_rng(3)
    headings = random.uniform(-pi, pi, count)
    one = [
        make_scene(np.array([(0.5, 0.0)]), np.ones(1), np.array([0.06]), h[None]) for h in headings
    ]
    scenes, bearing = np.stack(one), random.uniform(-pi, pi, count)
    heading = bearing + pi + random.uniform(-0.6, 0.6, count)
    across = heading + pi / 2 + random.uniform(-0.5, 0.5, count)
    span = random.uniform(0.02, 0.1, count)[:, None] * unit(across)
    start = scenes[:, 0, POSITION] + 0.1 * unit(bearing) - 0.5 * span
    speed, bar = random.choice([SLOW, FAST], count), random.integers(0, 2, count)
    strokes = make_stroke(start, heading, 0.08, speed=speed, tip_radius=TIP, span=span, bar=bar)
    outside = ~first_touch(scenes, strokes, bodies_of(name)).inside
    return scenes[outside], strokes[outside]


def swapped(strokes: Pushes) -> Pushes:
    """Return the same tools with the other disk first."""
    other = strokes.copy()
    other[:, START] += strokes[:, SPAN]
    other[:, SPAN] *= -1.0
    return other


def assert_near(scenes: Scenes, others: Scenes, place: float = 5e-4, turn: float = 0.03) -> None:
    """Check that bodies are no farther apart than this [m, rad]."""
    assert np.linalg.norm((scenes - others)[..., POSITION], axis=-1).max() < place
    assert np.abs(wrap_angle((scenes - others)[..., THETA])).max() < turn


@pytest.mark.parametrize("speed", [SLOW, FAST])
@pytest.mark.parametrize("bar", [False, True])
@pytest.mark.parametrize("config", [PlanarConfig(), OFF_CENTRE, PlanarConfig(tool_compliance=1e-4)])
def test_two_contacts_push_a_square_straight_where_one_turns_it(speed, bar, config):
    prior, scenes = PlanarPrior(config, SQUARE), square()
    straight = prior.step(scenes, tool(-0.03, 0.03, bar=bar, speed=speed))
    way = 0.06 - (0.08 - HALF - TIP)
    assert abs(straight[0, 0, THETA]) < 1e-3
    np.testing.assert_allclose(
        straight[0, 0, POSITION], [0.5 + way, 0.0], atol=0.015 * (speed > SLOW) + 2e-4
    )
    turns = prior.step(scenes, tool(0.0 if config is OFF_CENTRE else 0.02, speed=speed))
    assert abs(turns[0, 0, THETA]) > 0.15


def test_coincident_disks_and_one_that_touches_alone_are_one_disk():
    scenes, strokes = draw("t")
    prior = PlanarPrior(PlanarConfig(), bodies_of("t"))
    alone = strokes.copy()
    alone[:, SPAN] = 0.0  # whether it is a bar does not matter
    one = alone.copy()
    one[:, STROKE_SIZE - 1] = 0.0
    expected = prior.step(scenes, one)
    np.testing.assert_array_equal(prior.step(scenes, alone), expected)
    far = one.copy()
    far[:, SPAN] = -0.3 * unit(one[:, LOCATION])  # behind the first one
    np.testing.assert_allclose(prior.step(scenes, far), expected, atol=1e-9)
    assert np.abs((expected - scenes)[..., POSITION]).max() > 0.02


@pytest.mark.parametrize("speed", [SLOW, FAST])
def test_a_bar_against_an_edge_is_two_fingers_at_its_ends(speed):
    scenes, prior = square(), PlanarPrior(OFF_CENTRE, SQUARE)
    ends = prior.step(scenes, tool(-0.04, 0.04, speed=speed))
    bar = prior.step(scenes, tool(-0.04, 0.04, bar=True, speed=speed))
    assert_near(bar, ends, 1e-6, 1e-6)
    # One that sticks out touches with its face: as fingers at the corners of the square.
    wide = prior.step(scenes, tool(-0.2, 0.2, bar=True, speed=speed))
    assert_near(wide, ends, 1e-4, 1e-3)
    # Fingers so far apart pass by.
    np.testing.assert_array_equal(prior.step(scenes, tool(-0.2, 0.2, speed=speed)), scenes)


def test_a_tool_stays_what_it_is_as_a_stroke():
    stroke = tool(-0.02, 0.03, bar=True)
    np.testing.assert_array_equal(as_strokes(square(), stroke, PushLimits(), SQUARE), stroke)


def test_a_corner_meets_the_face_of_a_bar():
    """A square that stands on its corner, and one a little turned, which the bar turns flush."""
    scenes, prior = square(pi / 4), PlanarPrior(PlanarConfig(), SQUARE)
    stroke = tool(-0.05, 0.05, bar=True)
    stroke[0, START] -= (0.02, 0.0)
    touch = first_touch(scenes, stroke, SQUARE)
    gap = 0.1 - np.sqrt(2.0) * HALF - TIP
    np.testing.assert_allclose([touch.gap[0], touch.distance[0]], gap, atol=1e-9)
    np.testing.assert_allclose(touch.normal, 0.0, atol=1e-9)
    after = prior.step(scenes, stroke)
    np.testing.assert_allclose(after[0, 0, :2], [0.5 + 0.06 - gap, 0.0], atol=1e-6)
    turned = prior.step(square(0.2), tool(-0.05, 0.05, bar=True))
    assert abs(turned[0, 0, THETA]) < 1e-3


@pytest.mark.parametrize("name", ["cube", "l", "star", "ellipse"])
def test_tools_obey_the_symmetries_of_the_plane_and_stay_outside(name):
    scenes, strokes = draw(name)
    bodies = bodies_of(name)
    prior = PlanarPrior(PlanarConfig(), bodies)
    after = prior.step(scenes, strokes)
    # Contacts are solved one after another, as exact as `CONVERGED`: bodies on an edge of two ways
    # may differ by more than rounding.
    assert_near(prior.step(scenes, swapped(strokes)), after)
    turned = prior.step(rotate_scenes(scenes, 0.7), rotate_pushes(strokes, 0.7))
    assert_near(turned, rotate_scenes(after, 0.7))
    if name != "l":  # it has no line of symmetry along its x axis
        mirrored = prior.step(mirror_scenes(scenes), mirror_pushes(strokes))
        assert_near(mirrored, mirror_scenes(after))
    there = strokes.copy()
    there[:, START] += strokes[:, LENGTH, None] * unit(strokes[:, LOCATION])
    assert first_touch(after, there, bodies).gap.min() > -2e-4
    assert np.isfinite(first_touch(scenes, strokes, bodies).distance).mean() > 0.8


@pytest.mark.parametrize("name", ["cube", "star"])
def test_the_network_sees_both_disks_and_no_order_of_them(name):
    scenes, strokes = draw(name)
    bodies = bodies_of(name)
    after = PlanarPrior(PlanarConfig(), bodies).step(scenes, strokes)

    def look(at: Scenes, pushes: Pushes, moved: Scenes) -> np.ndarray:
        frames = push_frames(at, pushes, bodies)
        return network_inputs(NetworkConfig(), at, frames, moved, bodies).relations

    seen = look(scenes, strokes, after)
    np.testing.assert_allclose(look(scenes, swapped(strokes), after), seen, atol=2e-4)
    turned = (rotate_scenes(scenes, 0.7), rotate_pushes(strokes, 0.7), rotate_scenes(after, 0.7))
    np.testing.assert_allclose(look(*turned), seen, atol=2e-4)
    one = strokes.copy()
    one[:, SPAN] = 0.0
    assert np.abs(look(scenes, one, after) - seen).max(axis=(1, 2)).min() > 1e-2


def test_a_second_disk_inside_a_body_and_spans_that_cannot_be_are_refused():
    prior, scenes = PlanarPrior(PlanarConfig(), SQUARE), square()
    for stroke in (tool(-0.09, 0.0), tool(-0.09, 0.09, bar=True)):
        stroke[0, START] += (0.08, 0.0)
        with pytest.raises(
            InvalidInputError, match=r"stroke 0 begins with the tool .* mm inside body 0"
        ):
            prior.step(scenes, stroke)
    with pytest.raises(
        OutOfRangeError, match=r"span_y of push \(0,\) is 60.0; allowed: -0.5 to 0.5"
    ):
        prior.step(scenes, tool(0.0, 60.0))
    stroke = tool(-0.02, 0.02)
    stroke[0, -1] = 0.5
    with pytest.raises(OutOfRangeError, match=r"bar of push \(0,\) is 0.5; allowed: 0 or 1"):
        prior.step(scenes, stroke)
