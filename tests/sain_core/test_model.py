import re
import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from sain_core import model
from sain_core.errors import ConfigError, ModelUnavailableError
from sain_core.guarding import plugins
from sain_core.model import IdentityPrior, Model, check_rollout, check_step
from sain_core.push import LENGTH, PUSH_SIZE, idle_pushes
from sain_core.scene import MASS, make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import PushHistory
from sain_core.types import Pushes, Scenes


class Shift(Model):
    """Moves every disk along x by the push's length: where a sequence leads is easy to tell."""

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        after = scenes.copy()
        after[..., 0] += pushes[..., None, LENGTH]
        return after


def test_a_rollout_feeds_predictions_back():
    scene = np.arange(16.0).reshape(2, 8)
    pushes = np.random.default_rng(0).uniform(size=(5, 4, PUSH_SIZE))
    predicted = Shift().rollout(scene, pushes)
    assert predicted.shape == (5, 4, 2, 8)
    moved = predicted[..., 0] - scene[:, 0]
    expected = np.broadcast_to(np.cumsum(pushes[..., LENGTH], axis=1)[..., None], moved.shape)
    np.testing.assert_allclose(moved, expected)
    np.testing.assert_array_equal(predicted[..., 1:], np.broadcast_to(scene[:, 1:], (5, 4, 2, 7)))


def test_a_beginning_that_sequences_share_is_predicted_once():
    sizes = []

    class Counting(Shift):
        def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
            sizes.append(len(pushes))
            return super().step(scenes, pushes)

    scene, model = np.zeros((2, 8)), Counting()
    pushes = np.random.default_rng(0).uniform(size=(6, 3, PUSH_SIZE))
    pushes[1], pushes[3, :2], pushes[5, 0] = pushes[0], pushes[2, :2], pushes[4, 0]
    expected = np.cumsum(pushes[..., LENGTH], axis=1)
    np.testing.assert_allclose(model.rollout(scene, pushes)[..., 0, 0], expected)
    assert sizes == [3, 4, 5]


def test_step_alone_gives_a_model():
    model = Shift()
    scene, pushes = np.zeros((2, 8)), np.ones((3, 2, PUSH_SIZE))
    assert model.regions(scene, pushes, model.rollout(scene, pushes)) is None
    assert model.condition(PushHistory.empty()) is model
    assert model.with_unknown_masses() is model
    assert model.refused is None
    with pytest.raises(ConfigError, match="Shift takes no belief; 'sain' does"):
        model.with_belief(Path("belief.json"))
    with pytest.raises(ConfigError, match="Shift can only predict disks"):
        model.with_bodies(Bodies.named(("t",)))


SCENE = make_scene(np.array([(0.4, 0.0), (0.6, 0.0)]), np.array([8.0, 7.5]), np.array([0.08, 0.06]))
SCENES = np.stack([SCENE] * 3)
SEQUENCES = idle_pushes(3, 4)
PREDICTED = np.broadcast_to(SCENE, (3, 4, 2, 8)).copy()


def spoilt(predicted: np.ndarray, column: int, value: float) -> np.ndarray:
    other = predicted.copy()
    other[1, ..., 1, column] = value
    return other


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (None, "model 'x' returned a NoneType; it must return a NumPy array"),
        (SCENES[:2], "predicted scenes of shape (2, 2, 8); the shape must be (3, 2, 8)"),
        (spoilt(SCENES, 0, np.nan), "model 'x' predicts NaN or Inf in 1 of 48 numbers"),
        (spoilt(SCENES, MASS, 7.0), "model 'x' predicted disks of other masses or radii"),
        (SCENES[:, ::-1], "disks must stay in their order"),
    ],
)
def test_a_step_that_cannot_be_an_answer_is_refused(answer, message):
    with pytest.raises(ModelUnavailableError, match=re.escape(message)):
        check_step(answer, SCENES, "model 'x'")
    with pytest.raises(ModelUnavailableError, match=r"of shape \(3, 3, 2, 8\); the shape must be"):
        check_rollout(PREDICTED[:, :3], SCENE, SEQUENCES)


@pytest.fixture
def asked(monkeypatch):
    """A package that offers dynamics, and the names that it was asked for."""
    names: list[str] = []
    module = ModuleType("offering")
    module.load = lambda name: names.append(name) or IdentityPrior()  # type: ignore[attr-defined]
    module.broken = lambda name: object()  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "offering", module)
    offered = {"planar": "load", "checkpoint": "load", "broken": "broken"}
    entries = [EntryPoint(n, f"offering:{f}", model.GROUP) for n, f in offered.items()]
    monkeypatch.setattr(plugins, "entry_points", lambda group: entries)
    return names


def test_an_unknown_name_is_refused_with_the_nearest(asked):
    message = r"model 'planer' is unknown \(did you mean 'planar'\?\); known: broken, planar"
    with pytest.raises(ConfigError, match=message):
        model.load_dynamics("planer")
    with pytest.raises(ConfigError, match="offering:broken returned a object; a model inherits"):
        model.load_dynamics("broken")
    assert not asked


class Weighing(IdentityPrior):
    def with_unknown_masses(self) -> "Weighed":
        return Weighed()


class Weighed(IdentityPrior):
    pass


def test_a_dynamics_infers_masses_that_are_not_measured_if_it_can():
    assert isinstance(model.as_observed(Weighing(), "mass"), Weighed)
    assert isinstance(model.as_observed(Weighing(), ""), Weighing)
    assert isinstance(model.as_observed(IdentityPrior(), "mass"), IdentityPrior)
    with pytest.raises(ConfigError, match="unknown is 'weight'; allowed: mass"):
        model.as_observed(IdentityPrior(), "weight")
