"""What the planar prior does when it is told what is unlike the textbook."""

import numpy as np
import pytest

from sain_core.errors import InvalidInputError
from sain_core.push import LENGTH, make_push, mirror_pushes, rotate_pushes
from sain_core.scene import (
    MID,
    POSITION,
    RADIUS,
    TARGET,
    THETA,
    make_scene,
    mirror_scenes,
    rotate_scenes,
    wrap_angle,
)
from sain_model.physics import corrections as told
from sain_model.physics.planar import PlanarPrior
from sain_model.physics.planar_config import AXES


def draw_corrections(scenes: np.ndarray, seed: int = 0) -> np.ndarray:
    shape = (*scenes.shape[:2], told.CORRECTIONS)
    return np.random.default_rng(seed).normal(0.0, 1.0, shape)


def close(first: np.ndarray, second: np.ndarray) -> None:
    np.testing.assert_allclose(first[..., POSITION], second[..., POSITION], atol=5e-6)
    turned = wrap_angle(first[..., THETA] - second[..., THETA])
    np.testing.assert_allclose(turned, 0.0, atol=5e-5)


def test_told_nothing_it_is_the_prior(random_pushes) -> None:
    scenes, pushes = random_pushes(50, 0)
    nothing = np.zeros((50, 2, told.CORRECTIONS))
    for prior in (PlanarPrior(), PlanarPrior(AXES)):
        plain = prior.step(scenes, pushes)
        # The two are compiled apart, and round apart.
        np.testing.assert_allclose(
            prior.step_conditioned(scenes, pushes, nothing), plain, atol=1e-9
        )


def test_what_is_told_of_one_push_does_not_leak_into_the_next(random_pushes) -> None:
    scenes, pushes = random_pushes(40, 1)
    corrections, prior = draw_corrections(scenes), PlanarPrior()
    together = prior.step_conditioned(scenes, pushes, corrections)
    for row in range(40):
        one = slice(row, row + 1)
        alone = prior.step_conditioned(scenes[one], pushes[one], corrections[one])
        np.testing.assert_array_equal(alone[0], together[row])


def test_a_push_of_no_length_moves_nothing_whatever_is_told(random_pushes) -> None:
    scenes, pushes = random_pushes(20, 2)
    pushes[:, LENGTH] = 0.0
    after = PlanarPrior().step_conditioned(scenes, pushes, draw_corrections(scenes))
    np.testing.assert_array_equal(after, scenes)


def test_a_turned_scene_with_a_turned_slope_ends_turned(random_pushes) -> None:
    scenes, pushes = random_pushes(40, 3)
    corrections, prior, angle = draw_corrections(scenes), PlanarPrior(), 1.3
    pull, most = slice(told.PULL_X, told.PULL_Y + 1), told.MOST[told.PULL_X]
    corrections[..., pull] *= 0.1  # far from where a component saturates
    turned = corrections.copy()
    slope = told.saturated(corrections)[..., pull]
    cos, sin = np.cos(angle), np.sin(angle)
    slope = slope @ np.array([[cos, sin], [-sin, cos]])
    turned[..., pull] = np.arctanh(slope / most) * most / told.UNIT[told.PULL_X]
    after = prior.step_conditioned(scenes, pushes, corrections)
    other = prior.step_conditioned(
        rotate_scenes(scenes, angle), rotate_pushes(pushes, angle), turned
    )
    close(other, rotate_scenes(after, angle))


def test_a_mirrored_scene_with_mirrored_corrections_ends_mirrored(random_pushes) -> None:
    scenes, pushes = random_pushes(40, 4)
    corrections, prior = draw_corrections(scenes), PlanarPrior()
    mirrored = corrections.copy()
    odd = [told.PULL_Y, told.MASS_LEFT, told.ANGLE, told.LOCATION]
    mirrored[..., odd] *= -1.0
    after = prior.step_conditioned(scenes, pushes, corrections)
    other = prior.step_conditioned(mirror_scenes(scenes), mirror_pushes(pushes), mirrored)
    close(other, mirror_scenes(after))


def test_more_drag_stops_a_disk_sooner_and_a_slope_carries_it_down() -> None:
    places = np.array([[0.45, 0.0], [0.45, 0.3]])
    scene = make_scene(places, np.full(2, 8.0), np.array([0.08, 0.06]), np.zeros(2))[None]
    push, prior = make_push(0.0, 0.0, 0.1)[None], PlanarPrior()
    corrections = np.zeros((1, 2, told.CORRECTIONS))
    plain = prior.step(scene, push)[0]
    corrections[..., told.DRAG] = 1.0
    # The tool touches after 5 mm, and brakes for the last 5 mm; from there the disk coasts.
    let_go = 0.45 + 0.1 - 0.005 - 0.005
    coasted = plain[MID, 0] - let_go
    dragged = prior.step_conditioned(scene, push, corrections)[0, MID, 0] - let_go
    factor = np.exp(told.MOST[told.DRAG] * np.tanh(told.UNIT[told.DRAG] / told.MOST[told.DRAG]))
    assert 0.005 < dragged < coasted and coasted / dragged == pytest.approx(factor, rel=0.05)
    corrections[:] = 0.0
    corrections[..., told.PULL_Y] = 1.0
    down = prior.step_conditioned(scene, push, corrections)[0]
    assert down[MID, 1] - plain[MID, 1] > 1e-3
    np.testing.assert_array_equal(down[TARGET], scene[0, TARGET])  # friction holds what lies still


def test_a_push_through_the_middle_turns_a_disk_whose_mass_is_to_one_side() -> None:
    places = np.array([[0.45, 0.0], [0.45, 0.3]])
    scene = make_scene(places, np.full(2, 8.0), np.array([0.08, 0.06]), np.zeros(2))[None]
    push = make_push(0.0, 0.0, 0.05)[None]
    corrections = np.zeros((1, 2, told.CORRECTIONS))
    prior = PlanarPrior()
    assert abs(prior.step_conditioned(scene, push, corrections)[0, MID, THETA]) < 1e-6
    turned = []
    for side in (1.0, -1.0):
        corrections[0, MID, told.MASS_LEFT] = side  # on the left of the push: it stays behind
        turned.append(prior.step_conditioned(scene, push, corrections)[0, MID, THETA])
    assert turned[0] > 0.01 and turned[0] == pytest.approx(-turned[1], abs=1e-6)


def test_corrections_saturate_where_they_would_be_no_physics(random_pushes) -> None:
    scenes, pushes = random_pushes(30, 6)
    huge = 1e3 * np.sign(draw_corrections(scenes))
    assert (np.abs(told.saturated(huge)) <= told.MOST).all()
    after = PlanarPrior().step_conditioned(scenes, pushes, huge)
    assert np.isfinite(after).all()
    assert (after[..., RADIUS] == scenes[..., RADIUS]).all()


def test_corrections_that_do_not_fit_are_refused(random_pushes) -> None:
    scenes, pushes = random_pushes(3, 7)
    with pytest.raises(InvalidInputError, match=r"shape \(3, 2, 10\), not \(3, 2, 9\)"):
        PlanarPrior().step_conditioned(scenes, pushes, np.zeros((3, 2, 9)))
    corrections = np.zeros((3, 2, 10))
    corrections[1, 0, 4] = np.nan
    with pytest.raises(InvalidInputError, match=r"corrections\[1, 0, 4\] is nan"):
        PlanarPrior().step_conditioned(scenes, pushes, corrections)
