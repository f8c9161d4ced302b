"""Bodies of any shape with corrected parameters."""

import numpy as np
import pytest

from sain_core.push import BODY, LENGTH, make_push
from sain_core.scene import POSITION, THETA, make_scene, rotate_scenes, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.types import Pushes, Scenes
from sain_model.physics import corrections as told
from sain_model.physics.planar import PlanarPrior
from sain_model.physics.planar_config import AXES

PAIR = Bodies.named(["t", "star"], ["pushable", "pushable"])
ELLIPSE = Bodies.named(["ellipse"])


def draw(count: int, seed: int = 0) -> tuple[Scenes, Pushes]:
    random = np.random.default_rng(seed)
    places = np.array([(0.45, 0.0), (0.58, 0.02)])
    scene = make_scene(places, np.array([8.0, 7.5]), np.array([0.07, 0.06]), np.array([0.3, 1.0]))
    pushes = np.column_stack(
        [
            random.uniform(-3, 3, count),
            random.uniform(-0.7, 0.7, count),
            random.uniform(0.05, 0.15, count),
            random.integers(2, size=count),
        ]
    )
    return np.repeat(scene[None], count, axis=0), pushes


def draw_corrections(scenes: Scenes, seed: int = 0) -> told.Corrections:
    shape = (*scenes.shape[:2], told.CORRECTIONS)
    return np.random.default_rng(seed).normal(0.0, 1.0, shape)


def close(first: Scenes, second: Scenes) -> None:
    np.testing.assert_allclose(first[..., POSITION], second[..., POSITION], atol=1e-6)
    turned = wrap_angle(first[..., THETA] - second[..., THETA])
    np.testing.assert_allclose(turned, 0.0, atol=1e-5)


@pytest.mark.parametrize("prior", [PlanarPrior(), PlanarPrior(AXES)], ids=["planar", "axes"])
def test_without_corrections_it_is_the_prior_to_the_bit(prior: PlanarPrior) -> None:
    scenes, pushes = draw(60)
    shaped = prior.with_bodies(PAIR)
    nothing = np.zeros((60, 2, told.CORRECTIONS))
    corrected = shaped.step_conditioned(scenes, pushes, nothing)
    np.testing.assert_array_equal(corrected, shaped.step(scenes, pushes))


def test_corrections_of_one_push_do_not_leak_into_the_next() -> None:
    scenes, pushes = draw(30, 1)
    corrections, prior = draw_corrections(scenes), PlanarPrior().with_bodies(PAIR)
    together = prior.step_conditioned(scenes, pushes, corrections)
    for row in range(30):
        one = slice(row, row + 1)
        alone = prior.step_conditioned(scenes[one], pushes[one], corrections[one])
        np.testing.assert_array_equal(alone[0], together[row])


def test_a_push_of_no_length_moves_nothing() -> None:
    scenes, pushes = draw(10, 2)
    pushes[:, LENGTH] = 0.0
    prior = PlanarPrior().with_bodies(PAIR)
    after = prior.step_conditioned(scenes, pushes, draw_corrections(scenes))
    np.testing.assert_array_equal(after, scenes)


def test_a_turned_scene_with_a_turned_slope_ends_turned() -> None:
    scenes, pushes = draw(30, 3)
    corrections, prior, angle = draw_corrections(scenes), PlanarPrior().with_bodies(PAIR), 1.3
    pull, most = slice(told.PULL_X, told.PULL_Y + 1), told.MOST[told.PULL_X]
    corrections[..., pull] *= 0.1  # far from where a component saturates
    turned = corrections.copy()
    cos, sin = np.cos(angle), np.sin(angle)
    slope = told.saturated(corrections)[..., pull] @ np.array([[cos, sin], [-sin, cos]])
    turned[..., pull] = np.arctanh(slope / most) * most / told.UNIT[told.PULL_X]
    after = prior.step_conditioned(scenes, pushes, corrections)
    flat = pushes.copy()  # a place on an outline turns with the body
    other = prior.step_conditioned(rotate_scenes(scenes, angle), flat, turned)
    close(other, rotate_scenes(after, angle))


def test_renumbered_bodies_end_renumbered() -> None:
    scenes, pushes = draw(30, 4)
    corrections = draw_corrections(scenes)
    after = PlanarPrior().with_bodies(PAIR).step_conditioned(scenes, pushes, corrections)
    swapped = Bodies(PAIR.shapes[::-1], PAIR.roles[::-1])
    other = pushes.copy()
    other[:, BODY] = 1 - other[:, BODY]
    told_other = corrections[:, ::-1].copy()
    back = PlanarPrior().with_bodies(swapped).step_conditioned(scenes[:, ::-1], other, told_other)
    close(back[:, ::-1], after)


def test_more_drag_shortens_the_way_and_a_slope_carries_it_down() -> None:
    scene = make_scene(np.array([(0.5, 0.0)]), np.array([8.0]), np.array([0.08]))[None]
    push, prior = make_push(0.0, 0.0, 0.1)[None], PlanarPrior().with_bodies(ELLIPSE)
    none = np.zeros((1, 1, told.CORRECTIONS))
    plain = prior.step_conditioned(scene, push, none)[0, 0]
    slow, down = none.copy(), none.copy()
    slow[..., told.DRAG] = 1.0
    down[..., told.PULL_Y] = 1.0
    way = np.linalg.norm(plain[:2] - scene[0, 0, :2])
    dragged = prior.step_conditioned(scene, push, slow)[0, 0]
    assert np.linalg.norm(dragged[:2] - scene[0, 0, :2]) < way - 1e-3
    assert prior.step_conditioned(scene, push, down)[0, 0, 1] > plain[1] + 1e-3


def test_what_is_not_touched_stays_to_the_bit_whatever_its_centre_of_mass() -> None:
    scenes, pushes = draw(20, 5)
    scenes[:, 1, 0] += 0.3
    pushes[:, BODY] = 0.0
    corrections = draw_corrections(scenes)
    after = PlanarPrior().with_bodies(PAIR).step_conditioned(scenes, pushes, corrections)
    np.testing.assert_array_equal(after[:, 1], scenes[:, 1])


def test_a_mass_to_one_side_turns_an_ellipse_that_is_pushed_through_the_middle() -> None:
    scene = make_scene(np.array([(0.5, 0.0)]), np.array([8.0]), np.array([0.08]))[None]
    prior = PlanarPrior().with_bodies(ELLIPSE)
    push = make_push(0.0, 0.0, 0.05)[None]
    turned = []
    for side in (0.0, 1.0, -1.0):
        corrections = np.zeros((1, 1, told.CORRECTIONS))
        corrections[0, 0, told.MASS_LEFT] = side
        turned.append(prior.step_conditioned(scene, push, corrections)[0, 0, THETA])
    assert turned[1] - turned[0] > 0.01
    assert turned[2] - turned[0] < -0.01


def test_corrections_saturate_where_they_would_be_no_physics() -> None:
    scenes, pushes = draw(30, 6)
    huge = 1e3 * np.sign(draw_corrections(scenes))
    after = PlanarPrior().with_bodies(PAIR).step_conditioned(scenes, pushes, huge)
    assert np.isfinite(after).all()


def test_a_disk_as_an_outline_is_corrected_as_a_disk() -> None:
    """Both kernels have the same physics, solved in other steps."""
    scene = make_scene(np.array([(0.45, 0.0), (0.7, 0.0)]), np.full(2, 8.0), np.full(2, 0.07))
    scenes = np.repeat(scene[None], 20, axis=0)
    pushes = make_push(
        *np.random.default_rng(7).uniform([-0.5, -0.5, 0.05], [0.5, 0.5, 0.15], (20, 3)).T
    )
    corrections = draw_corrections(scenes, 7)
    round_ones = PlanarPrior().step_conditioned(scenes, pushes, corrections)
    mixed = Bodies.named(["disk", "square"])
    outlines = PlanarPrior().with_bodies(mixed).step_conditioned(scenes, pushes, corrections)
    apart = np.linalg.norm((outlines - round_ones)[:, 0, POSITION], axis=-1)
    way = np.linalg.norm((round_ones - scenes)[:, 0, POSITION], axis=-1)
    assert np.median(apart / way) < 0.05
