"""Features: what acts between bodies, however their shapes are written, and what is believed."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sain_core.push import ANGLE, BODY, LENGTH, LOCATION, PushLimits, make_push, mirror_pushes
from sain_core.scene import THETA, make_scene, mirror_scenes, wrap_angle
from sain_core.shapes.bodies import PAPER_DISKS, Bodies, Role
from sain_core.shapes.library import get_shape
from sain_core.shapes.solids import Compound
from sain_core.types import Pushes, Scenes
from sain_model.dynamics.residual import CompiledNetwork
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
    MIRRORED_BODY,
    MIRRORED_RELATION,
    PLACE_SCALE,
    SENDER,
)
from sain_model.network.features import (
    BELIEVED_FEATURES,
    MIRRORED_BELIEVED,
    Features,
    network_inputs,
    push_frames,
)
from sain_model.network.interaction_network import InteractionNetwork, TorchNetwork, new_network
from sain_model.network.settings import FRAMES, NetworkConfig
from sain_model.physics.parameters import Values
from tests.strokes import rotate_pushes, rotate_scenes

CONFIG = NetworkConfig()
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


def features_of(
    scenes: Scenes, pushes: Pushes, after: Scenes, bodies: Bodies, config: NetworkConfig = CONFIG
) -> Features:
    frames = push_frames(scenes, pushes, bodies)
    return network_inputs(config, scenes, frames, after, bodies)


def assert_same(first: Features, second: Features) -> None:
    np.testing.assert_allclose(first.bodies, second.bodies, atol=2e-5)
    np.testing.assert_allclose(first.relations, second.relations, atol=2e-4)


def test_two_ways_to_write_an_outline_look_the_same():
    halves = Compound.of(
        "t of halves",
        ((2.0, 3.0), (4.0, 3.0), (4.0, 4.0), (2.0, 4.0)),
        ((1.5, 0.0), (2.5, 0.0), (2.5, 3.0), (1.5, 3.0)),
        ((0.0, 3.0), (2.0, 3.0), (2.0, 4.0), (0.0, 4.0)),
    )
    spun = Compound.of(
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


def test_a_turned_scene_looks_the_same():
    bodies = bodies_of(*NAMES)
    scenes, pushes, after = draw(5, 80)
    turned = pushes.copy()
    rounded = np.array([shape.is_round for shape in bodies.shapes])[pushes[:, BODY].astype(int)]
    turned[:, LOCATION] = np.where(
        rounded, wrap_angle(pushes[:, LOCATION] + 0.7), pushes[:, LOCATION]
    )
    other = (rotate_scenes(some, 0.7) for some in (scenes, after))
    before, physics = other
    assert_same(
        features_of(scenes, pushes, after, bodies), features_of(before, turned, physics, bodies)
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
        Compound.of(
            f"{name} in a mirror",
            *(tuple((x, -y) for x, y in reversed(part)) for part in get_shape(name).polygons),
        )
        for name in ("right_triangle", "random_0")
    )
    bodies = bodies_of("right_triangle", "random_0")
    scenes, pushes, after = draw(2, 60)
    image = pushes.copy()
    image[:, LOCATION], image[:, ANGLE] = wrap_angle(-pushes[:, LOCATION]), -pushes[:, ANGLE]
    usual = features_of(scenes, pushes, after, bodies)
    told = features_of(
        mirror_scenes(scenes), image, mirror_scenes(after), Bodies(mirrored, (Role.PUSHABLE,) * 2)
    )
    usual.bodies[..., list(MIRRORED_BODY)] *= -1
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


@pytest.mark.parametrize("frame", FRAMES)
def test_kernels_say_what_pytorch_says(frame):
    torch.manual_seed(0)
    network = InteractionNetwork(replace(CONFIG, members=2, features=frame)).eval()
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.add_(0.1 * torch.randn_like(parameter))
    bodies = bodies_of("t", "disk", "star")
    scenes, pushes, after = draw(3, 150)
    pushes[::7, LENGTH] = 0.0
    compiled = CompiledNetwork(network.weights).correct(scenes, pushes, after, bodies)
    told = TorchNetwork(network.weights, "cpu").correct(scenes, pushes, after, bodies)
    np.testing.assert_allclose(compiled, told, atol=2e-6)
    np.testing.assert_array_equal(compiled[::7], after[::7])
    assert np.abs(compiled - after)[..., :2].max() > 1e-3


SEEING = NetworkConfig(believed=True)
SEEN = (
    "tool_friction", "torsion", "pressure", "centre_x", "centre_y", "grain_x", "grain_y",
    "table_grain_x", "table_grain_y", "tip_x", "tip_y",
)  # fmt: skip
ODD = ("centre_y", "grain_y", "table_grain_y", "tip_y")  # in a mirror


def draw_believed(count: int = 20) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    random = np.random.default_rng(0)
    scene = make_scene(np.array([(0.5, 0.0), (0.7, 0.03)]), np.full(2, 8.0), np.full(2, 0.08))
    scenes = np.repeat(scene[None], count, axis=0)
    scenes[..., THETA] = random.uniform(-3.0, 3.0, scenes.shape[:2])
    pushes = make_push(*random.uniform((-3.0, -0.7, 0.05), (3.0, 0.7, 0.15), (count, 3)).T)
    values = {name: random.uniform(0.01, 0.3, count) for name in SEEN}
    values["centre_x"] = random.uniform(-0.1, 0.1, (count, 2))  # of each body its own
    return scenes, pushes, values


def believed(scenes: np.ndarray, pushes: np.ndarray, values: Values) -> np.ndarray:
    frames = push_frames(scenes, pushes, PAPER_DISKS)
    features = network_inputs(SEEING, scenes, frames, scenes, PAPER_DISKS, values)
    return features.bodies[..., BODY_FEATURES:]


def test_each_parameter_is_seen():
    scenes, pushes, values = draw_believed()
    before = believed(scenes, pushes, values)
    assert before.shape == (20, 2, BELIEVED_FEATURES)
    for name in SEEN:
        after = believed(scenes, pushes, values | {name: values[name] + 0.1})
        assert (np.abs(after - before).max(axis=(1, 2)) > 0.01).all(), name


def test_what_is_believed_turns_with_the_scene():
    scenes, pushes, values = draw_believed()
    before, angle = believed(scenes, pushes, values), 0.7
    turned = dict(values)
    for name, times in (("table_grain", 2.0), ("tip", 1.0)):
        x, y = values[f"{name}_x"], values[f"{name}_y"]
        cos, sin = np.cos(times * angle), np.sin(times * angle)
        turned |= {f"{name}_x": cos * x - sin * y, f"{name}_y": sin * x + cos * y}
    after = believed(rotate_scenes(scenes, angle), rotate_pushes(pushes, angle), turned)
    np.testing.assert_allclose(after, before, atol=1e-5)


def test_in_a_mirror_what_lies_across_the_push_changes_its_sign():
    scenes, pushes, values = draw_believed()
    expected = believed(scenes, pushes, values)
    expected[..., list(MIRRORED_BELIEVED)] *= -1.0
    image = values | {name: -values[name] for name in ODD}
    after = believed(mirror_scenes(scenes), mirror_pushes(pushes), image)
    np.testing.assert_allclose(after, expected, atol=1e-5)


@pytest.mark.parametrize("frame", ["push", "world"])
def test_kernels_see_what_pytorch_sees(frame):
    scenes, pushes, values = draw_believed()
    network = new_network(NetworkConfig(believed=True, features=frame, members=2), 0)
    with torch.no_grad():
        for weights in network.parameters():
            weights.add_(0.05 * torch.randn_like(weights))
    expected = TorchNetwork(network.weights, "cpu").correct(
        scenes, pushes, scenes, PAPER_DISKS, values
    )
    found = CompiledNetwork(network.weights).correct(scenes, pushes, scenes, PAPER_DISKS, values)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    other = CompiledNetwork(network.weights).correct(scenes, pushes, scenes, PAPER_DISKS)
    assert np.abs(other - found).max() > 1e-5
