"""Laws of the planar prior: symmetries, mechanics, and any number of disks."""

import numba
import numpy as np
import pytest

from sain_core.errors import ConfigError, InvalidInputError
from sain_core.feasibility import Feasibility
from sain_core.model import Model
from sain_core.push import (
    LENGTH,
    PushLimits,
    make_push,
    mirror_pushes,
    push_direction,
    rotate_pushes,
)
from sain_core.scene import (
    MASS,
    MID,
    POSITION,
    RADIUS,
    TARGET,
    THETA,
    VELOCITY,
    X,
    Y,
    make_scene,
    mirror_scenes,
    rotate_scenes,
    surface_gaps,
    unit,
    wrap_angle,
)
from sain_core.types import Pushes, Scenes
from sain_model.evaluation.named_models import step_as_nominal
from sain_model.physics.planar import PlanarConfig, PlanarPrior, check_batch
from sain_model.physics.planar_config import AXES

BATCH = 200
LIMITS = PushLimits()


def draw(disks: int, seed: int = 0, batch: int = BATCH) -> tuple[Scenes, Pushes]:
    """Draw scenes of touching or near disks and pushes that can be carried out."""
    random = np.random.default_rng(seed)
    scenes = []
    while len(scenes) < batch:
        positions = np.array([0.45, 0.0]) + random.uniform(-0.25, 0.25, (disks, 2))
        bearing = random.uniform(-np.pi, np.pi)
        positions[TARGET] = positions[MID] + 0.141 * unit(np.array(bearing))
        radii = np.r_[0.08, np.full(disks - 1, 0.06)]
        headings = random.uniform(-3.0, 3.0, disks)
        scene = make_scene(positions, random.uniform(7.0, 9.0, disks), radii, headings)
        if surface_gaps(scene).min() > 0.0:
            scenes.append(scene)
    return np.stack(scenes), LIMITS.sample(random, batch)


def close(first: Scenes, second: Scenes, tolerance: float = 2e-6) -> None:
    np.testing.assert_allclose(first[..., POSITION], second[..., POSITION], atol=tolerance)
    turned = wrap_angle(first[..., THETA] - second[..., THETA])
    np.testing.assert_allclose(turned, 0.0, atol=10 * tolerance)


@pytest.fixture(scope="module")
def prior() -> PlanarPrior:
    return PlanarPrior()


def test_it_is_a_dynamics(prior: PlanarPrior) -> None:
    assert isinstance(prior, Model)


@pytest.mark.parametrize("disks", [2, 3, 5])
def test_a_push_of_no_length_changes_not_a_bit(prior: PlanarPrior, disks: int) -> None:
    scenes, pushes = draw(disks)
    scenes[..., VELOCITY] = 1e-4
    pushes[:, LENGTH] = 0.0
    assert prior.step(scenes, pushes).tobytes() == scenes.tobytes()


def test_the_input_is_left_alone_and_what_comes_out_is_settled(prior: PlanarPrior) -> None:
    scenes, pushes = draw(3)
    before = scenes.copy()
    after = prior.step(scenes, pushes)
    np.testing.assert_array_equal(scenes, before)
    np.testing.assert_array_equal(after[..., VELOCITY], 0.0)
    np.testing.assert_array_equal(after[..., MASS:], scenes[..., MASS:])
    assert (np.abs(after[..., THETA]) <= np.pi).all()
    assert np.abs(after - scenes).max() > 0.05


@pytest.mark.parametrize("disks", [2, 4])
@pytest.mark.parametrize("angle", [0.3, -2.0, np.pi / 2])
def test_turning_scene_and_push_turns_the_prediction(
    prior: PlanarPrior, disks: int, angle: float
) -> None:
    scenes, pushes = draw(disks)
    turned = prior.step(rotate_scenes(scenes, angle), rotate_pushes(pushes, angle))
    # A step that ends at a collision or a kink passes rounding on: 1 push in 200 by a micrometre.
    close(turned, rotate_scenes(prior.step(scenes, pushes), angle), tolerance=1e-5)


@pytest.mark.parametrize("disks", [2, 4])
def test_a_mirror_mirrors_the_prediction(prior: PlanarPrior, disks: int) -> None:
    scenes, pushes = draw(disks)
    mirrored = prior.step(mirror_scenes(scenes), mirror_pushes(pushes))
    close(mirrored, mirror_scenes(prior.step(scenes, pushes)))


def test_moving_the_scene_moves_the_prediction(prior: PlanarPrior) -> None:
    scenes, pushes = draw(3)
    away = scenes.copy()
    away[..., X] += 0.25
    away[..., Y] -= 0.5
    expected = prior.step(scenes, pushes)
    expected[..., X] += 0.25
    expected[..., Y] -= 0.5
    close(prior.step(away, pushes), expected)


def test_renumbering_the_extra_disks_renumbers_the_prediction_to_the_bit(
    prior: PlanarPrior,
) -> None:
    scenes, pushes = draw(5)
    order = [0, 1, 4, 2, 3]
    np.testing.assert_array_equal(
        prior.step(scenes[:, order], pushes), prior.step(scenes, pushes)[:, order]
    )


def test_a_far_disk_changes_nothing(prior: PlanarPrior) -> None:
    scenes, pushes = draw(2)
    far = scenes[:, TARGET:].copy()
    far[..., X] += 3.0
    more = prior.step(np.concatenate([scenes, far], axis=1), pushes)
    np.testing.assert_array_equal(more[:, :2], prior.step(scenes, pushes))
    np.testing.assert_array_equal(more[:, 2:], far)


def test_a_batch_is_a_loop_on_any_number_of_threads(prior: PlanarPrior) -> None:
    scenes, pushes = draw(3, batch=70)
    threads = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        alone = prior.step(scenes, pushes)
    finally:
        numba.set_num_threads(threads)
    assert prior.step(scenes, pushes).tobytes() == alone.tobytes()
    for index in range(0, 70, 7):
        one = slice(index, index + 1)
        assert prior.step(scenes[one], pushes[one]).tobytes() == alone[one].tobytes()


def test_a_straight_push_ends_where_mechanics_says() -> None:
    """The disk leaves the braking tool at its speed v and slides on by v^2 / (2 mu g)."""
    prior = PlanarPrior(PlanarConfig(tool_restitution=0.0, friction_scale=1.0))
    positions = np.array([[0.4, 0.0], [0.4, 0.5]])
    scene = make_scene(positions, np.array([8.0, 8.0]), np.array([0.08, 0.06]))
    for length, friction in ((0.05, 0.12), (0.15, 0.08), (0.1, 0.2)):
        known = {"friction": np.array([friction])}
        after = prior.step(scene[None], make_push([0.0], 0.0, length), known)
        braking, sliding = 0.2**2 / (2 * 4.0), 0.2**2 / (2 * friction * 9.81)
        expected = length - 0.005 - braking + sliding
        assert after[0, MID, X] - 0.4 == pytest.approx(expected, abs=2e-4)
        assert after[0, MID, Y] == pytest.approx(0.0, abs=1e-12)
        np.testing.assert_array_equal(after[0, TARGET], scene[TARGET])


def test_the_step_is_fine_enough() -> None:
    scenes, pushes = draw(2)
    possible = Feasibility(limits=LIMITS).assess(scenes, pushes)[1] > 0.002
    fine = PlanarConfig(longest_step=1 / 1000)
    after, exact = (PlanarPrior(c).step(scenes, pushes) for c in (PlanarConfig(), fine))
    off = np.linalg.norm((after - exact)[possible][..., POSITION], axis=-1)
    assert np.median(off) < 2e-4
    assert np.quantile(off, 0.95) < 1e-3


def test_pushed_disks_move_along_with_the_push_and_gain_no_energy(prior: PlanarPrior) -> None:
    """Nothing gets farther than the tool's way and a slide from its speed, bounce included."""
    scenes, pushes = draw(3)
    possible = Feasibility(limits=LIMITS).assess(scenes, pushes)[1] > 0.002
    way = unit(push_direction(pushes))
    moved = (prior.step(scenes, pushes) - scenes)[..., POSITION]
    along = (moved[:, MID] * way).sum(-1)
    assert (along[possible] > -1e-9).all()
    fastest = 0.2 * (1 + prior.config.tool_restitution) * (1 + prior.config.disk_restitution)
    farthest = pushes[:, LENGTH] + fastest**2 / (2 * 0.12 * 9.81)
    distance = np.linalg.norm(moved, axis=-1).max(axis=-1)
    assert (distance[possible] < farthest[possible] + 1e-3).all()


def test_the_heavier_and_the_rougher_move_less() -> None:
    prior = PlanarPrior()
    positions = np.array([[0.4, 0.0], [0.6, 0.0]])
    scenes = np.stack(
        [make_scene(positions, np.array([8.0, m]), np.array([0.08, 0.06])) for m in (4.0, 16.0)]
    )
    pushes = make_push(0.0, 0.0, [0.065, 0.065])
    light, heavy = prior.step(scenes, pushes)[:, TARGET, X]
    assert light > heavy > 0.6
    smooth, rough = (
        prior.step(scenes[:1], pushes[:1], {"friction": np.array([friction])})[0, TARGET, X]
        for friction in (0.08, 0.2)
    )
    assert smooth > rough


def test_disks_never_end_up_inside_each_other(prior: PlanarPrior) -> None:
    scenes, pushes = draw(5)
    possible = Feasibility(limits=LIMITS).assess(scenes, pushes)[1] > 0.002
    assert surface_gaps(prior.step(scenes, pushes)[possible]).min() > -5e-4


def test_the_tool_pushes_any_disk_and_says_so(prior: PlanarPrior) -> None:
    """A disk in the tool's way beside the mid disk is touched first, and pushed."""
    positions = np.array([[0.45, 0.0], [0.6, 0.0], [0.44, 0.101]])
    scene = make_scene(positions, np.full(3, 8.0), np.array([0.08, 0.06, 0.02]))
    pushes = make_push(0.0, [np.pi / 4, 0.0], [0.15, 0.1])
    after, touched = prior.step_with_contacts(np.stack([scene, scene]), pushes)
    assert touched.tolist() == [[True, False, True], [True, False, False]]
    assert np.linalg.norm((after[0, 2] - scene[2])[POSITION]) > 0.005


def test_the_nominal_belief_changes_masses_and_radii_only_inside(prior: PlanarPrior) -> None:
    scenes, pushes = draw(2)
    nominal = scenes.copy()
    nominal[..., MASS] = 8.0
    np.testing.assert_array_equal(
        step_as_nominal(prior, nominal, pushes), prior.step(nominal, pushes)
    )
    scenes[:, MID, RADIUS] = 0.078
    believed = step_as_nominal(prior, scenes, pushes)
    np.testing.assert_array_equal(believed[..., MASS:], scenes[..., MASS:])
    assert np.abs(believed - prior.step(scenes, pushes)).max() > 1e-3


def test_bad_input_is_refused_by_name(prior: PlanarPrior) -> None:
    scenes, pushes = draw(2, batch=3)
    broken = scenes.copy()
    broken[1, 0, X] = np.nan
    with pytest.raises(InvalidInputError, match=r"scenes\[1, 0, 0\] is nan; it must be finite"):
        prior.step(broken, pushes)
    broken[1, 0, X], broken[2, 1, MASS] = 0.0, 0.0
    with pytest.raises(
        InvalidInputError, match=r"mass of disk 1 in scene 2 is 0.0; it must be pos"
    ):
        prior.step(broken, pushes)
    with pytest.raises(InvalidInputError, match=r"pushes have shape \(3, 5\), one for each"):
        check_batch(scenes, pushes[:2])
    with pytest.raises(InvalidInputError, match=r"scenes have shape \(B, N, 8\) with N = 1 to 32"):
        check_batch(scenes[:, :0], pushes)


def test_settings_are_checked() -> None:
    with pytest.raises(ConfigError, match=r"PlanarConfig.friction is -0.1; it must be at least"):
        PlanarConfig(friction=-0.1)


def test_friction_along_the_axes_turns_by_quarters_and_in_their_mirror() -> None:
    scenes, pushes = draw(2, seed=3, batch=60)
    prior = PlanarPrior(AXES)
    expected = prior.step(scenes, pushes)

    def off(angle: float) -> float:
        turned = prior.step(rotate_scenes(scenes, angle), rotate_pushes(pushes, angle))
        away = turned - rotate_scenes(expected, angle)
        return float(np.abs(away[..., POSITION]).max())

    assert off(np.pi / 2) < 1e-6
    assert off(np.pi / 4) > 1e-3
    mirrored = prior.step(mirror_scenes(scenes), mirror_pushes(pushes))
    away = mirrored - mirror_scenes(expected)
    assert np.abs(away[..., POSITION]).max() < 1e-6
