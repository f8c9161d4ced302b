from pathlib import Path

import numpy as np
import pytest

from sain_core.errors import ConfigError
from sain_core.model import IdentityPrior, Model, as_model
from sain_core.push import LENGTH, PUSH_SIZE
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import PushHistory
from sain_core.types import Pushes, Scenes


class Shift(Model):
    """Moves every disk along x by the push's length: where a sequence leads is easy to tell."""

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        after = scenes.copy()
        after[..., 0] += pushes[..., None, LENGTH]
        return after


def test_a_rollout_feeds_predictions_back() -> None:
    scene = np.arange(16.0).reshape(2, 8)
    pushes = np.random.default_rng(0).uniform(size=(5, 4, PUSH_SIZE))
    predicted = Shift().rollout(scene, pushes)
    assert predicted.shape == (5, 4, 2, 8)
    moved = predicted[..., 0] - scene[:, 0]
    expected = np.broadcast_to(np.cumsum(pushes[..., LENGTH], axis=1)[..., None], moved.shape)
    np.testing.assert_allclose(moved, expected)
    np.testing.assert_array_equal(predicted[..., 1:], np.broadcast_to(scene[:, 1:], (5, 4, 2, 7)))


def test_a_dynamics_is_not_asked_about_rests() -> None:
    counts: list[int] = []

    class Counting(Shift):
        def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
            counts.append(len(scenes))
            assert (pushes[:, LENGTH] > 0.0).all()
            return super().step(scenes, pushes)

    pushes = np.ones((4, 3, PUSH_SIZE))
    pushes[1:, 1, LENGTH] = 0.0
    pushes[:, 2, LENGTH] = 0.0
    predicted = Counting().rollout(np.zeros((2, 8)), pushes)
    assert counts == [4, 1]
    np.testing.assert_array_equal(predicted[:, -1, 0, 0], [2.0, 1.0, 1.0, 1.0])


def test_the_identity_prior_moves_nothing_and_gives_a_copy() -> None:
    scenes = np.ones((3, 2, 8))
    after = IdentityPrior().step(scenes, np.ones((3, PUSH_SIZE)))
    np.testing.assert_array_equal(after, scenes)
    after += 1
    assert (scenes == 1).all()


class Stranger:
    """Has `step` alone, counts refusals, and has to be closed."""

    refused = 3
    closed = False

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        return scenes + 1.0

    def close(self) -> None:
        self.closed = True


def test_step_alone_gives_a_model() -> None:
    stranger = Stranger()
    model = as_model(stranger)
    assert as_model(model) is model
    scene, pushes = np.zeros((2, 8)), np.ones((3, 2, PUSH_SIZE))
    predicted = model.rollout(scene, pushes)
    np.testing.assert_array_equal(predicted[:, 1], np.full((3, 2, 8), 2.0))
    assert model.regions(scene, pushes, predicted) is None
    assert model.condition(PushHistory.empty()) is model
    assert model.with_unknown_masses() is model
    assert model.refused == 3 and Shift().refused is None
    with pytest.raises(ConfigError, match="Stranger takes no belief; 'sain' does"):
        model.with_belief(Path("belief.json"))
    with pytest.raises(ConfigError, match="Stranger can only predict disks"):
        model.with_bodies(Bodies.named(("t",)))
    model.close()
    assert stranger.closed


class OfBefore(Stranger):
    def with_history(self, history: PushHistory) -> "OfBefore":
        return self


def test_what_can_be_no_model_is_refused_and_told_what_is_missing() -> None:
    with pytest.raises(ConfigError, match="a object has no method step"):
        as_model(object())
    with pytest.raises(ConfigError, match="a OfBefore has with_history, and does not inherit from"):
        as_model(OfBefore())


def test_a_model_of_disks_predicts_cubes_too_and_no_other_shape() -> None:
    model = Shift()
    assert model.with_bodies(Bodies.named(("disk", "cube"))) is model
    assert model.with_bodies(Bodies.disks(3)) is model
    with pytest.raises(ConfigError, match=r"Shift can only predict disks .* disk, t: use a"):
        model.with_bodies(Bodies.named(("disk", "t")))
