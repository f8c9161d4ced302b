"""The planar prior with parameters of its own for each push and each body."""

from dataclasses import replace

import numba
import numpy as np
import pytest

from sain_core.errors import InvalidInputError
from sain_core.push import ANGLE, BODY, LOCATION, SPEED
from sain_core.scene import POSITION, THETA, mirror_scenes, wrap_angle
from sain_core.shapes.bodies import Bodies, Role
from sain_core.types import Scenes
from sain_model.physics.parameters import AXES, BY_NAME, OF_BODIES, PlanarConfig
from sain_model.physics.planar import PlanarPrior
from tests.sain_model.conftest import push_two_bodies
from tests.strokes import rotate_scenes

EVERY = ("disk", "disk"), ("t", "star"), ("disk", "half_ring")
ON_BOTH = pytest.mark.parametrize("bottom", ["feet", "flat"])


def kinds(*names: str) -> Bodies:
    return Bodies.named(list(names), [Role.PUSHABLE] * len(names))


WIDE = (
    "friction_scale", "torsion", "pressure", "centre_x", "centre_y", "slope_x", "slope_y",
    "length_offset", "angle_offset", "location_offset",
)  # fmt: skip


def draw_values(count: int, bodies: int, seed: int = 0) -> dict[str, np.ndarray]:
    """Return values of all parameters, near to those that a laboratory might have."""
    random, values = np.random.default_rng(seed), {}
    for one in BY_NAME.values():
        shape = (count, bodies) if one.scope == "body" else (count,)
        usual = getattr(PlanarConfig(), one.name)
        spread = 0.2 if one.name in WIDE else one.spread
        away = random.normal(0.0, spread, shape)
        if "_offset" in one.name or one.name.startswith("slope"):
            away *= 0.1
        drawn = usual * np.exp(away) if one.logarithm else usual + away
        values[one.name] = np.clip(drawn, one.least, one.most)
    values["axes_yield"][:] = 0.0  # the others commute with turning
    return values


def close(first: Scenes, second: Scenes) -> None:
    """The solver stops when it has converged, so last digits differ, and contacts amplify them."""
    off = np.abs(first[..., POSITION] - second[..., POSITION])
    turned = np.abs(wrap_angle(first[..., THETA] - second[..., THETA]))
    assert np.quantile(off, 0.9) < 5e-6 and off.max() < 3e-4
    assert np.quantile(turned, 0.9) < 5e-5 and turned.max() < 3e-3


@pytest.mark.parametrize(
    ("config", "bottom"), [(PlanarConfig(), "feet"), (AXES, "feet"), (PlanarConfig(), "flat")]
)
@pytest.mark.parametrize("names", EVERY)
def test_the_values_of_the_settings_change_no_bit(names, config, bottom):
    scenes, pushes = push_two_bodies(40)
    prior = PlanarPrior(config, kinds(*names).on(bottom))
    values = {one.name: np.full(40, getattr(config, one.name)) for one in BY_NAME.values()}
    np.testing.assert_array_equal(prior.step(scenes, pushes, values), prior.step(scenes, pushes))
    each = {name: np.full((40, 2), getattr(config, name)) for name in OF_BODIES}
    np.testing.assert_array_equal(prior.step(scenes, pushes, each), prior.step(scenes, pushes))


@ON_BOTH
@pytest.mark.parametrize("names", EVERY)
def test_a_batch_is_a_loop_to_the_bit_on_any_number_of_threads(names, bottom):
    scenes, pushes = push_two_bodies(30, 1)
    before = scenes.copy()
    values, prior = draw_values(30, 2, 1), PlanarPrior(PlanarConfig(), kinds(*names).on(bottom))
    together, threads = prior.step(scenes, pushes, values), numba.get_num_threads()
    np.testing.assert_array_equal(scenes, before)
    try:
        numba.set_num_threads(1)
        assert prior.step(scenes, pushes, values).tobytes() == together.tobytes()
    finally:
        numba.set_num_threads(threads)
    for row in range(30):
        one = slice(row, row + 1)
        own = {name: value[one] for name, value in values.items()}
        np.testing.assert_array_equal(prior.step(scenes[one], pushes[one], own)[0], together[row])


@ON_BOTH
@pytest.mark.parametrize("names", EVERY)
def test_a_turned_scene_on_a_turned_slope_ends_turned(names, bottom):
    scenes, pushes = push_two_bodies(30, 4)
    values, angle = draw_values(30, 2, 4), 1.3
    prior = PlanarPrior(PlanarConfig(), kinds(*names).on(bottom))
    after = prior.step(scenes, pushes, values)
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = values["slope_x"], values["slope_y"]
    turned = values | {"slope_x": cos * x - sin * y, "slope_y": sin * x + cos * y}
    x, y = values["tip_x"], values["tip_y"]
    turned |= {"tip_x": cos * x - sin * y, "tip_y": sin * x + cos * y}
    cos, sin = np.cos(2.0 * angle), np.sin(2.0 * angle)
    x, y = values["table_grain_x"], values["table_grain_y"]
    turned |= {"table_grain_x": cos * x - sin * y, "table_grain_y": sin * x + cos * y}
    for offset in ("length_offset", "angle_offset", "location_offset"):
        for order in (1, 2):
            cos, sin = np.cos(order * angle), np.sin(order * angle)
            names_of_both = f"{offset}_cos{order}", f"{offset}_sin{order}"
            x, y = (values[name] for name in names_of_both)
            turned |= dict(zip(names_of_both, (cos * x - sin * y, sin * x + cos * y), strict=True))
    other = pushes.copy()  # a place on an outline turns with the body, one on a disk does not
    round_ones = np.array([name == "disk" for name in names])[pushes[:, BODY].astype(int)]
    other[round_ones, LOCATION] = wrap_angle(other[round_ones, LOCATION] + angle)
    close(prior.step(rotate_scenes(scenes, angle), other, turned), rotate_scenes(after, angle))


@pytest.mark.parametrize("names", [("disk", "disk"), ("disk:flat", "square:flat")])
def test_a_mirrored_scene_ends_mirrored(names):
    scenes, pushes = push_two_bodies(30, 5)
    values, prior = draw_values(30, 2, 5), PlanarPrior(PlanarConfig(), kinds(*names))
    odd = ("slope_y", "centre_y", "angle_offset", "location_offset", "tip_y")
    odd += ("grain_y", "table_grain_y", "length_offset_sin1", "length_offset_sin2")
    odd += tuple(f"{one}_offset_cos{order}" for one in ("angle", "location") for order in (1, 2))
    mirrored = values | {name: -values[name] for name in odd}
    other = pushes.copy()
    other[:, BODY] = pushes[:, BODY] = 0.0  # a disk
    other[:, [LOCATION, ANGLE]] *= -1.0
    after = prior.step(scenes, pushes, values)
    close(prior.step(mirror_scenes(scenes), other, mirrored), mirror_scenes(after))


@pytest.mark.parametrize("names", EVERY)
def test_renumbered_bodies_end_renumbered(names):
    scenes, pushes = push_two_bodies(30, 6)
    values = draw_values(30, 2, 6)
    after = PlanarPrior(PlanarConfig(), kinds(*names)).step(scenes, pushes, values)
    other = pushes.copy()
    other[:, BODY] = 1 - other[:, BODY]
    swapped = {
        name: value[:, ::-1].copy() if value.ndim == 2 else value for name, value in values.items()
    }
    swapped["mass_ratio"] = 1.0 / values["mass_ratio"]
    back = PlanarPrior(PlanarConfig(), kinds(*names[::-1]))
    close(back.step(scenes[:, ::-1].copy(), other, swapped)[:, ::-1], after)


@pytest.mark.parametrize("name", BY_NAME)
def test_every_parameter_counts(name):
    scenes, pushes = push_two_bodies(30, 7)
    one = BY_NAME[name]
    prior = PlanarPrior(replace(PlanarConfig(), tool_restitution=0.3), kinds("disk:flat", "t:flat"))
    usual = getattr(prior.config, name)
    changed = 1.3 * usual if one.logarithm else usual + 0.3 * (one.most - usual)
    if changed == usual:
        changed = 0.5 * (one.least + usual)
    after = prior.step(scenes, pushes, {name: np.full(30, changed)})
    assert np.abs(after - prior.step(scenes, pushes))[..., : THETA + 1].max() > 1e-5


@ON_BOTH
@pytest.mark.parametrize("names", EVERY)
def test_no_allowed_value_gives_nan(names, bottom):
    scenes, pushes = push_two_bodies(200, 8)
    random, values = np.random.default_rng(8), {}
    for one in BY_NAME.values():
        shape = (200, 2) if one.scope == "body" else (200,)
        usual = getattr(PlanarConfig(), one.name)
        choices = np.array([one.least, one.most, usual])
        values[one.name] = random.choice(choices, shape, p=[0.2, 0.2, 0.6])
    prior = PlanarPrior(PlanarConfig(), kinds(*names).on(bottom))
    assert np.isfinite(prior.step(scenes, pushes, values)).all()
    level = values | {"slope_x": np.zeros(200), "slope_y": np.zeros(200)}
    moved = prior.step(scenes, pushes, level) - scenes
    speed = pushes[:, SPEED] * values["speed_factor"] * (1 + values["tool_restitution"])
    speed *= 1 + values["disk_restitution"]  # what a light body leaves a heavy one with
    slowing = 9.81 * values["friction"] * values["friction_scale"].min(axis=1)
    farthest = 0.3 + 5.0 * speed**2 / slowing
    assert (np.abs(moved[..., POSITION]).max(axis=(1, 2)) < farthest).all()


def test_what_is_no_value_is_refused_by_name():
    scenes, pushes = push_two_bodies(3)
    prior = PlanarPrior(PlanarConfig(), kinds("t", "star"))

    def refused(message: str, **values: np.ndarray) -> None:
        with pytest.raises(InvalidInputError, match=message):
            prior.step(scenes, pushes, values)

    refused(r"no parameter 'frction'; it has: friction, ", frction=np.full(3, 0.1))
    refused(r"friction has shape \(3,\), not \(2,\)", friction=np.full(2, 0.1))
    refused(r"friction has shape \(3,\), not \(3, 2\)", friction=np.full((3, 2), 0.1))
    refused(r"centre_x has shape \(3,\) or \(3, 2\), not \(3, 1\)", centre_x=np.zeros((3, 1)))
    refused(r"friction\[1\] is nan; it must be finite", friction=np.array([0.1, np.nan, 0.1]))
    refused(r"friction\[0\] is -0.1; allowed: 0.005 to 10", friction=np.full(3, -0.1))
    refused(r"slope_x\[0, 1\] is 3.0 m/s\^2; all", slope_x=np.array([(0, 3.0)] * 3))
