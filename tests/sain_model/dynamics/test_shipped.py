"""The model `sain`: one network for the paper's disks and for all other bodies."""

import hashlib

import numpy as np
import pytest

from sain_core.model import load_dynamics
from sain_core.push import LENGTH, PushLimits, as_strokes
from sain_core.randomness import generator
from sain_core.scene import POSITION, THETA, make_scene, wrap_angle
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.transitions import PushHistory
from sain_core.types import Pushes, Scene
from sain_model.dynamics.load import shipped_checkpoint
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.kinds import FRICTION
from sain_model.physics.parameters import TEXTBOOK
from sain_model.physics.planar import PlanarPrior
from tests.sain_model.conftest import read_card

PAIR = ("pushable", "pushable")
OTHERS = {
    "a T alone": Bodies.named(["t"]),
    "a cube as target": Bodies.named(["disk", "cube"]),
    "two shapes": Bodies.named(["star", "l"], PAIR),
    "two disks that the tool may touch": Bodies.named(["disk", "disk"], PAIR),
    "three": Bodies.named(["disk", "u", "box_2x1"]),
    "a wall": Bodies.named(["t", "bar"], ["pushable", "fixed"]),
}


@pytest.fixture(scope="module")
def sain():
    return load_dynamics("sain")


def scene_of(count: int) -> Scene:
    places = np.array([(0.45, 0.0), (0.58, 0.02), (0.5, -0.2)])[:count]
    return make_scene(places, np.linspace(8.0, 7.0, count), np.full(count, 0.06))


def pushes(count: int) -> Pushes:
    return PushLimits().sample(np.random.default_rng(3), count)


@pytest.mark.parametrize("bodies", [Bodies.disks(2), Bodies.disks(3)])
def test_named_disks_are_the_papers_disks(sain, bodies):
    scene, pushed = scene_of(len(bodies)), pushes(40)
    scenes = np.repeat(scene[None], len(pushed), axis=0)
    expected = sain.with_bodies(PAPER_DISKS).step(scenes, pushed)
    np.testing.assert_array_equal(sain.with_bodies(bodies).step(scenes, pushed), expected)


@pytest.mark.parametrize("name", OTHERS)
def test_any_bodies_are_corrected_but_little(sain, name):
    bodies = OTHERS[name]
    placed = sain.with_bodies(bodies)
    assert placed.bodies == bodies
    scene, pushed = scene_of(len(bodies)), pushes(40)
    scenes = np.repeat(scene[None], len(pushed), axis=0)
    physics = placed.physics.step(scenes, pushed)
    residual = np.linalg.norm((placed.step(scenes, pushed) - physics)[..., :2], axis=-1)
    assert 1e-6 < residual.max() < 0.02
    assert not residual[:, list(bodies.fixed)].any()
    radius = placed.predict(scenes, pushed).radius
    assert ((radius > 0.0) & (radius < 0.2)).all()


def test_the_card_belongs_to_the_weights():
    path = shipped_checkpoint()
    card = read_card(path)
    assert card.weights_sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert card.prior == "planar_axes"
    assert card.bottoms == ["feet", "flat"]
    assert {"bullet rough, feet", "mujoco measured, flat"} < card.data["worlds"]["test"].keys()
    assert card.data["transitions"]["train"] > 10_000
    assert len(card.data["sha256"]) == 64
    assert card.command.startswith("ros2 run sain_model train ")


@pytest.mark.parametrize("names", [["t:flat"], ["disk:flat", "t:flat"]])
def test_pushes_that_physics_explains_switch_the_network_off(sain, names):
    placed = sain.with_bodies(Bodies.named(names))
    scenes, pushed = np.repeat(scene_of(len(names))[None], 12, axis=0), pushes(12)
    after = placed.physics.step(scenes, pushed, {FRICTION: np.full(len(pushed), 0.18)})
    assert placed.corrects
    model = placed.condition(PushHistory(scenes, pushed, after))
    assert not model.corrects
    np.testing.assert_array_equal(model.step(scenes, pushed), model.physics.step(scenes, pushed))


def test_pushes_of_a_flat_body_show_where_its_mass_is(sain):
    """And how hard it is to turn: as of a real body on its surface."""
    bodies, random = Bodies.named(["box_3x2:flat"]), generator(0, "own values")
    limits = PushLimits(tool_radius=0.00475, speed=0.02)
    drawn = limits.sample(random, 40)
    drawn[:, LENGTH] = random.uniform(0.03, 0.06, 40)
    scenes = np.repeat(scene_of(1)[None], 40, axis=0)
    strokes = as_strokes(scenes, drawn, limits, bodies)
    values = {"centre_x": 0.12, "centre_y": -0.08, "torsion": 0.7, "tool_friction": 0.3}
    truth = PlanarPrior(TEXTBOOK, bodies)
    after = truth.step(scenes, strokes, {name: np.full(40, one) for name, one in values.items()})

    def off(model: SainDynamics, row: int) -> tuple[float, float]:
        return pose_errors(model.step(scenes[row:][:1], strokes[row:][:1])[0], after[row])

    known = sain.with_bodies(bodies)
    shown = known.condition(PushHistory(scenes[:15], strokes[:15], after[:15]))
    before, afterwards = (
        np.mean([off(model, row) for row in range(15, 40)], axis=0) for model in (known, shown)
    )
    assert (afterwards < 0.25 * before).all()
    assert shown.value("centre_x") == pytest.approx(0.12, abs=0.03)


def pose_errors(predicted: Scene, actual: Scene) -> tuple[float, float]:
    off = predicted[0] - actual[0]
    return float(np.hypot(*off[POSITION])), abs(float(wrap_angle(off[THETA])))
