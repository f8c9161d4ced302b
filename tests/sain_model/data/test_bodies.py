"""Bodies on surfaces: what a robot's pushes of them show, from a data set to a model."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp

from sain_core.errors import CheckpointError, DatasetError
from sain_core.push import make_stroke, push_direction
from sain_core.scene import POSITION, RADIUS, THETA, make_scene, turned, unit
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import PushHistory
from sain_model.data.dataset import Dataset, Part, Split
from sain_model.dynamics.identify import (
    body_names,
    identify_bodies,
    infer_bodies,
    states_bodies,
    with_beliefs,
)
from sain_model.dynamics.load import load_checkpoint, save_checkpoint
from sain_model.dynamics.sain import SainDynamics, residual_model, weights_of
from sain_model.inference.kinds import read_belief, surface_kind, write_belief
from sain_model.inference.population import Pair
from sain_model.network.interaction_network import InteractionNetwork
from sain_model.network.settings import PLANAR, NetworkConfig
from sain_model.training.fit import fit, identified_kind, make_card
from sain_model.training.settings import TrainingConfig, TrainOptions
from tests.sain_model.conftest import make_part

TRUTH = {  # values of bodies on surfaces, by object and surface
    ("square", "steel"): {"tool_friction": 0.3, "torsion": 1.0, "centre_x": 0.05},
    ("square", "wood"): {"tool_friction": 0.12, "torsion": 1.2, "centre_x": 0.05},
    ("disk", "steel"): {"tool_friction": 0.2, "torsion": 0.8, "centre_x": -0.05},
}


def pushed(name: str, surface: str, count: int, seed: int = 0) -> Part:
    """Return pushes as the physics with the true values has them."""
    random, bodies = np.random.default_rng(seed), Bodies.named([name])
    scene = make_scene(np.array([(0.5, 0.0)]), np.array([8.0]), np.array([0.06]))
    states = np.repeat(scene[None], count, axis=0)
    states[:, 0, THETA] = random.uniform(-3.0, 3.0, count)
    heading = random.uniform(-3.0, 3.0, count)
    aside = random.uniform(-0.03, 0.03, (count, 1)) * unit(heading + np.pi / 2)
    start = states[:, 0, POSITION] - 0.08 * unit(heading) + aside
    strokes = make_stroke(start, heading, 0.05, speed=0.02, tip_radius=0.005)
    values = {one: np.full(count, value) for one, value in TRUTH[name, surface].items()}
    after = surface_kind().step(bodies, states, strokes, values)
    about = {"surface": np.full(count, surface), "object": np.full(count, name)}
    about["run"], episode = np.full(count, "1"), np.arange(count) + 1000 * seed
    return make_part(states, strokes, after, episode, bodies=bodies, **about)


@pytest.fixture(scope="module")
def data():
    parts = [pushed(*pair, 40, seed) for seed, pair in enumerate(TRUTH)]
    square = {
        name: np.concatenate([getattr(part, name) for part in parts[:2]])
        for name in (*parts[0].arrays, "surface", "object", "run")
    }
    return Dataset((replace(parts[0], **square), parts[2]), sha256="x")


def test_own_pushes_show_what_a_body_is_like(data):
    assert states_bodies(data)
    assert set(body_names(data.parts[0])) == {"square on steel", "square on wood"}
    kind = surface_kind()
    population = infer_bodies(kind, data)
    for (name, surface), truth in TRUTH.items():
        found = kind.values(population.place(Pair(name, surface))[None])
        for one, value in truth.items():
            assert found[one][0] == pytest.approx(value, abs=0.15 * abs(value) + 0.01), one
    believed = with_beliefs(data, population)
    part = believed.parts[0]
    off = kind.step(part.bodies, part.state, part.action, part.given) - part.next_state
    assert np.median(np.abs(off[..., POSITION])) < 1e-4


def test_a_belief_of_bodies_is_trained_on_saved_and_conditioned(data, tmp_path):
    belief = identify_bodies(data)
    assert set(belief.card["bodies"]) == {"square on steel", "square on wood", "disk on steel"}
    again = read_belief(write_belief(tmp_path / "belief.json", belief))
    assert again.likeliest.identity == belief.likeliest.identity and again.likeliest.of_bodies
    small = NetworkConfig(hidden=8, message=4, layers=1)
    options = TrainingConfig(epochs=2, test=0.0, network=small)
    config, kind = identified_kind(tmp_path / "belief.json", options)
    assert config.network.believed and kind.of_bodies
    held = Dataset(tuple(part.select(slice(0, len(part), 4)) for part in data.parts))
    split = Split(data, held, held.select(np.zeros(len(held), bool)))
    model, histories = fit(split, kind, config, tmp_path / "run")
    command = TrainOptions(dataset=(tmp_path,), out=tmp_path, training=config)
    card = make_card(command, data, split, model, histories, {})
    save_checkpoint(tmp_path / "sain.safetensors", weights_of(model), card)
    loaded = load_checkpoint(tmp_path / "sain.safetensors").with_bodies(Bodies.named(["square"]))
    wood = pushed("square", "wood", 30, 7)
    before = loaded.physics_alone()
    first, rest = wood.select(slice(0, 10)), wood.select(slice(10, 30))
    history = PushHistory(first.state, first.action, first.next_state)
    informed = before.condition(history)

    def off(after: np.ndarray) -> float:
        return float(np.abs(after - rest.next_state)[..., POSITION].mean())

    assert off(informed.step(rest.state, rest.action)) < 0.5 * off(
        before.step(rest.state, rest.action)
    )
    assert not loaded.corrects, "the body is new to the network"
    conditioned = loaded.condition(history)
    assert not conditioned.corrects, "the network does not help"
    np.testing.assert_array_equal(
        conditioned.step(rest.state, rest.action), informed.step(rest.state, rest.action)
    )


def bent(part: Part, share: float = 0.2) -> Part:
    """Return pushes with errors that no parameter explains, the same on all surfaces."""
    state, after = part.state[:, 0], part.next_state.copy()
    heading = push_direction(part.action) - state[:, THETA]
    way = np.linalg.norm((after - part.state)[:, 0, POSITION], axis=1)
    off = share * way[:, None] * np.column_stack([np.sin(2.0 * heading), np.cos(3.0 * heading)])
    after[:, 0, POSITION] += turned(off, state[:, THETA])
    return replace(part, next_state=after)


def test_errors_of_a_body_on_one_surface_are_expected_on_another(tmp_path):
    lab = Dataset((bent(pushed("square", "steel", 60)), pushed("disk", "steel", 30, 2)), sha256="x")
    path = write_belief(tmp_path / "belief.json", identify_bodies(lab, surface="wood"))
    kind = replace(surface_kind(), corrected=True)
    model = residual_model(InteractionNetwork().weights, kind, PLANAR).with_belief(path)
    assert [body.name for body in model.belief.bodies] == ["disk", "square"]
    part = bent(pushed("square", "wood", 40, 7))
    first, rest = part.select(slice(0, 5)), part.select(slice(5, 40))
    history = PushHistory(first.state, first.action, first.next_state)

    def off(informed: SainDynamics) -> float:
        after = informed.step(rest.state, rest.action)
        return float(np.linalg.norm((after - rest.next_state)[..., POSITION], axis=-1).mean())

    forgets = replace(model, belief=replace(model.belief, bodies=()))
    for informed, other in (
        (model.with_bodies(part.bodies), forgets.with_bodies(part.bodies)),
        (
            model.with_bodies(part.bodies).condition(history),
            forgets.with_bodies(part.bodies).condition(history),
        ),
    ):
        assert off(informed) < 0.9 * off(other)
    stranger = model.with_bodies(Bodies.named(["t:flat"]))
    assert stranger.now.memories[0] is None and not stranger.belief.known(stranger.bodies)


def test_how_far_errors_on_two_surfaces_agree_is_inferred():
    one, same = (
        bent(pushed("square", name, 60, seed)) for name, seed in (("steel", 1), ("wood", 2))
    )
    other = bent(pushed("square", "wood", 60, 2), -0.2)
    odds = []
    for second in (same, other):
        both = {
            name: np.concatenate([getattr(part, name) for part in (one, second)])
            for name in (*one.arrays, "surface", "object", "run")
        }
        belief = identify_bodies(Dataset((replace(one, **both),), sha256="x"))
        odds.append(logsumexp(belief.bodies[0].log_odds, axis=0))
    assert odds[0].argmax() > 1 and odds[1].argmax() == 0


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        (("known", 0, "surfaces", 0, "torsion"), "nan", "torsion.* is nan"),
        (("known", 0, "surfaces", 0, "torsion"), -1.0, "torsion.* is -1.0; allowed"),
        (("known", 0, "surfaces", 0), {}, "values of a body are of"),
        (("known", 0, "surface", 0), 0.5, "surface of a body is float64"),
        (("known", 0, "kind", "log_odds"), "nan", "log_odds of a kind of physics is nan"),
        (("network_log_odds",), "nan", "network_log_odds is NaN"),
    ],
)
def test_a_damaged_belief_of_bodies_is_refused(data, tmp_path, place, value, message):
    path = write_belief(tmp_path / "belief.json", identify_bodies(data))
    content = json.loads(path.read_text())
    inner = content
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    path.write_text(json.dumps(content))
    with pytest.raises(CheckpointError, match=message):
        read_belief(path)


def test_bodies_and_surfaces_that_are_confused_are_named():
    disk, square = pushed("disk", "steel", 8), pushed("square", "steel", 8, 1)
    larger = disk.state.copy(), disk.next_state.copy()
    for scenes in larger:
        scenes[..., RADIUS] *= np.where(np.arange(8) < 4, 1.0, 1.2)[:, None]
    sized = replace(disk, state=larger[0], next_state=larger[1])
    named = replace(sized, object=np.array(["puck"] * 4 + ["coin"] * 4))

    def notices(part: Part, surface: str = "") -> str:
        return "; ".join(identify_bodies(Dataset((part,)), surface=surface).card["notices"])

    assert "nothing was pushed on surface 'stel': it is believed to be like steel" in notices(
        disk, "stel"
    )
    assert "steel" not in notices(disk, "steel").replace("disk on steel", "")
    assert "coin and puck have the same outline disk" in notices(named)
    assert "disk: pushes of radii from 60 to 72 mm are taken as one" in notices(sized)
    both = Dataset((square, replace(disk, object=square.object)))
    with pytest.raises(DatasetError, match="the body 'square' has two outlines: disk and square"):
        identify_bodies(both)
