"""Features: what acts between bodies, however their shapes are written, and what is believed."""

import numpy as np
import pytest

from sain_core.push import ANGLE, BODY, LENGTH, LOCATION, PushLimits, make_push
from sain_core.scene import POSITION, THETA, make_scene, mirror_scenes, wrap_angle
from sain_core.shapes.bodies import Bodies, Role
from sain_core.shapes.library import get_shape
from sain_core.shapes.solids import Prism
from sain_core.types import Pushes, Scenes
from sain_model.dynamics.sain import PhysicsPrediction, ResidualNetwork
from sain_model.network.feature_kernels import (
    BODY_FEATURES,
    CONTACT_BEFORE,
    EXTENT_BEFORE,
    EXTENT_SCALE,
    GAP_AFTER,
    GAP_BEFORE,
    GAP_SCALE,
    HEADINGS,
    IS_TOOL,
    MIRRORED_RELATION,
    PLACE_SCALE,
    SENDER,
)
from sain_model.network.features import (
    BELIEVED_FEATURES,
    Features,
    mirrored_columns,
    network_inputs,
    push_frames,
)
from sain_model.network.interaction_network import as_tensors
from sain_model.network.settings import NetworkConfig
from sain_model.physics.parameters import Values
from tests.sain_model.conftest import apply_residual, random_network
from tests.strokes import rotate_scenes

SEEING = NetworkConfig(believed=True)
SEEN = (
    "tool_friction", "torsion", "pressure", "centre_x", "centre_y", "grain_x", "grain_y",
    "table_grain_x", "table_grain_y", "tip_x", "tip_y",
)  # fmt: skip
ODD = ("centre_y", "grain_y", "table_grain_y", "tip_y")  # in a mirror
NAMES = ("t", "right_triangle", "disk", "ellipse", "l")
FEET = [5, 6, 16, 17, 18]  # features of where the supports are
PLACES = np.array([(0.45, 0.0), (0.57, 0.03), (0.5, 0.14), (0.44, -0.13), (0.72, 0.1)])


def bodies_of(*names: str) -> Bodies:
    return Bodies(tuple(map(get_shape, names)), (Role.PUSHABLE,) * len(names))


def draw(count: int, batch: int, seed: int = 0) -> tuple[Scenes, Pushes, Scenes]:
    """Return scenes, pushes (B, 5) of any body, and something that a prior could predict."""
    random = np.random.default_rng(seed)
    scenes = np.stack(
        [
            make_scene(
                PLACES[:count],
                random.uniform(7, 9, count),
                random.uniform(0.06, 0.07, count),
                random.uniform(-3, 3, count),
            )
            for _ in range(batch)
        ]
    )
    pushes = PushLimits().sample(random, batch)
    pushes[:, BODY] = random.integers(count, size=batch)
    after = scenes.copy()
    after[..., :3] += random.uniform(-0.02, 0.02, (batch, count, 3))
    return scenes, pushes, after


def draw_values(bodies: int, batch: int) -> dict[str, np.ndarray]:
    """Return what may be believed of the physics of each push; of one name, of each body."""
    random = np.random.default_rng(0)
    values = {name: random.uniform(0.01, 0.3, batch) for name in SEEN}
    return values | {"centre_x": random.uniform(-0.1, 0.1, (batch, bodies))}


def features_of(
    scenes: Scenes, pushes: Pushes, after: Scenes, bodies: Bodies, values: Values | None = None
) -> Features:
    frames = push_frames(scenes, pushes, bodies)
    return network_inputs(
        NetworkConfig(believed=values is not None), scenes, frames, after, bodies, values
    )


def assert_same(first: Features, second: Features) -> None:
    np.testing.assert_allclose(first.bodies, second.bodies, atol=2e-5)
    np.testing.assert_allclose(first.relations, second.relations, atol=2e-4)


def test_two_ways_to_write_an_outline_look_the_same():
    halves = Prism.of(
        "t of halves",
        ((2.0, 3.0), (4.0, 3.0), (4.0, 4.0), (2.0, 4.0)),
        ((1.5, 0.0), (2.5, 0.0), (2.5, 3.0), (1.5, 3.0)),
        ((0.0, 3.0), (2.0, 3.0), (2.0, 4.0), (0.0, 4.0)),
    )
    spun = Prism.of(
        "t from another corner",
        ((2.5, 0.0), (2.5, 3.0), (1.5, 3.0), (1.5, 0.0)),
        ((4.0, 4.0), (0.0, 4.0), (0.0, 3.0), (4.0, 3.0)),
    )
    scenes, pushes, after = draw(2, 60)
    usual = features_of(scenes, pushes, after, bodies_of("t", "l"))
    for other in (halves, spun):
        same = Bodies((other, get_shape("l")), (Role.PUSHABLE,) * 2)
        told = features_of(scenes, pushes, after, same)
        np.testing.assert_allclose(told.relations[..., :3], usual.relations[..., :3])
        geometry = slice(CONTACT_BEFORE, HEADINGS)
        np.testing.assert_allclose(
            told.relations[..., geometry], usual.relations[..., geometry], atol=2e-4
        )


def test_a_turned_scene_looks_the_same_and_what_is_believed_turns_with_it():
    bodies, angle = bodies_of(*NAMES), 0.7
    scenes, pushes, after = draw(5, 80)
    turned, values = pushes.copy(), draw_values(5, 80)
    rounded = np.array([shape.is_round for shape in bodies.shapes])[pushes[:, BODY].astype(int)]
    turned[rounded, LOCATION] = wrap_angle(pushes[rounded, LOCATION] + angle)
    other = dict(values)
    for name, times in (("table_grain", 2.0), ("tip", 1.0)):
        x, y = values[f"{name}_x"], values[f"{name}_y"]
        cos, sin = np.cos(times * angle), np.sin(times * angle)
        other |= {f"{name}_x": cos * x - sin * y, f"{name}_y": sin * x + cos * y}
    before, physics = (rotate_scenes(some, angle) for some in (scenes, after))
    assert_same(
        features_of(scenes, pushes, after, bodies, values),
        features_of(before, turned, physics, bodies, other),
    )


def test_renumbering_bodies_renumbers_rows():
    order = [2, 0, 4, 1, 3]
    scenes, pushes, after = draw(5, 40)
    renumbered = pushes.copy()
    renumbered[:, BODY] = np.argsort(order)[pushes[:, BODY].astype(int)]
    usual = features_of(scenes, pushes, after, bodies_of(*NAMES))
    told = features_of(
        scenes[:, order], renumbered, after[:, order], bodies_of(*(NAMES[i] for i in order))
    )
    pairs = np.arange(25).reshape(5, 5)
    slots = pairs[np.ix_(order, order)].ravel()
    assert_same(told, Features(usual.bodies[:, order], usual.relations[:, slots]))


def test_a_mirror_changes_signs_alone():
    mirrored = tuple(
        Prism.of(
            f"{name} in a mirror",
            *(tuple((x, -y) for x, y in reversed(part)) for part in get_shape(name).polygons),
        )
        for name in ("right_triangle", "random_0")
    )
    bodies = bodies_of("right_triangle", "random_0")
    scenes, pushes, after = draw(2, 60)
    image, values = pushes.copy(), draw_values(2, 60)
    image[:, LOCATION], image[:, ANGLE] = wrap_angle(-pushes[:, LOCATION]), -pushes[:, ANGLE]
    usual = features_of(scenes, pushes, after, bodies, values)
    told = features_of(
        mirror_scenes(scenes), image, mirror_scenes(after), Bodies(mirrored, (Role.PUSHABLE,) * 2),
        values | {name: -values[name] for name in ODD},
    )  # fmt: skip
    usual.bodies[..., list(mirrored_columns(SEEING))] *= -1
    usual.relations[..., list(MIRRORED_RELATION)] *= -1
    for some in (told, usual):  # a mirrored outline gets other feet, which are left out
        some.bodies[..., FEET] = 0.0
        some.relations[..., [SENDER + column for column in FEET]] = 0.0
    assert_same(told, usual)


def test_a_contact_is_where_two_sides_meet():
    """Two cubes of 0.1 m side by side, 4 mm apart, one of them 2 cm to the left."""
    places = np.array([(0.4, 0.0), (0.504, 0.02)])
    scenes = make_scene(places, np.full(2, 8.0), np.full(2, 0.05), np.zeros(2))[None]
    push = make_push(0.0, 0.0, 0.1)[None]  # against the middle of the side towards -x
    told = features_of(scenes, push, scenes, bodies_of("cube", "cube")).relations[0]
    there, tool = told[1], told[0]
    point, off, normal = (there[CONTACT_BEFORE + i : CONTACT_BEFORE + i + 2] for i in (0, 2, 4))
    np.testing.assert_allclose(point * PLACE_SCALE, [0.052, 0.01], atol=1e-6)
    np.testing.assert_allclose(off * PLACE_SCALE, [-0.052, -0.01], atol=1e-6)
    np.testing.assert_allclose(normal, [1.0, 0.0], atol=1e-6)
    assert there[EXTENT_BEFORE] * EXTENT_SCALE == pytest.approx(0.04, abs=1e-4)
    assert there[GAP_BEFORE] == pytest.approx(np.tanh(0.004 / GAP_SCALE), abs=1e-5)
    assert there[GAP_BEFORE] == there[GAP_AFTER]
    assert (there[IS_TOOL], tool[IS_TOOL]) == (0.0, 1.0)
    assert tool[GAP_BEFORE] == pytest.approx(np.tanh(0.005 / GAP_SCALE), abs=1e-5)


def test_each_parameter_is_seen():
    scenes, pushes, after = draw(2, 20)
    values, bodies = draw_values(2, 20), bodies_of("t", "disk")

    def believed(**more: np.ndarray) -> np.ndarray:
        features = features_of(scenes, pushes, after, bodies, values | more)
        return features.bodies[..., BODY_FEATURES:]

    before = believed()
    assert before.shape == (20, 2, BELIEVED_FEATURES)
    for name in SEEN:
        moved = np.abs(believed(**{name: values[name] + 0.1}) - before)
        assert (moved.max(axis=(1, 2)) > 0.01).all(), name


@pytest.mark.parametrize(
    "size",
    [
        {},
        {"hidden": 9, "message": 5, "layers": 1, "members": 2},
        {"hidden": 13, "message": 1, "layers": 3, "features": "world", "believed": True},
        {"believed": True, "members": 2},
    ],
)
def test_kernels_say_what_pytorch_says(size):
    network, bodies = random_network(0.1, **size), bodies_of("t", "disk", "star")
    scenes, pushes, after = draw(3, 150)
    pushes[::7, LENGTH] = 0.0
    asked = PhysicsPrediction(scenes, pushes, after, bodies)
    values = draw_values(3, 150)
    compiled = ResidualNetwork(network.weights).correct(asked._replace(values=values))
    frames = push_frames(scenes, pushes, bodies)
    seen = network_inputs(network.config, scenes, frames, after, bodies, values)
    residual = network(*as_tensors(seen)).detach().double().numpy()
    told = apply_residual(after, frames, residual)
    told[::7] = after[::7]
    np.testing.assert_allclose(compiled[..., POSITION], told[..., POSITION], rtol=0, atol=2e-7)
    np.testing.assert_allclose(wrap_angle(compiled - told)[..., THETA], 0, atol=1e-5)
    np.testing.assert_array_equal(compiled[..., THETA + 1 :], told[..., THETA + 1 :])
    np.testing.assert_array_equal(compiled[::7], after[::7])
    assert np.abs(compiled - after)[..., :2].max() > 1e-3
    other = ResidualNetwork(network.weights).correct(asked)
    assert (np.abs(other - compiled).max() > 1e-5) == ("believed" in size)
