"""Each rule of the contract is checked: a model that breaks one is refused by that rule."""

from collections.abc import Callable

import numpy as np
import pytest

from sain_core.conformance import check_dynamics, violations
from sain_core.errors import ModelUnavailableError
from sain_core.model import IdentityPrior, Model
from sain_core.push import LENGTH
from sain_core.scene import VX
from sain_core.types import Pushes, Scenes

Spoil = Callable[[Scenes, Pushes, Scenes], Scenes]


def shift(scenes: Scenes, pushes: Pushes) -> Scenes:
    predicted = scenes.copy()
    predicted[:, 0, 0] += pushes[:, LENGTH]
    return predicted


class Shifting(Model):
    """Shifts the mid disk; what it predicts is spoilt."""

    def __init__(self, spoil: Spoil) -> None:
        self.spoil = spoil

    def step(self, scenes: Scenes, pushes: Pushes) -> Scenes:
        return self.spoil(scenes, pushes, shift(scenes, pushes))


def moving(scenes: Scenes, pushes: Pushes, predicted: Scenes) -> Scenes:
    predicted[pushes[:, LENGTH] > 0.0, 1, VX] = 0.1
    return predicted


def in_place(scenes: Scenes, pushes: Pushes, predicted: Scenes) -> Scenes:
    scenes[...] = predicted
    return predicted


def by_batch(scenes: Scenes, pushes: Pushes, predicted: Scenes) -> Scenes:
    predicted[pushes[:, LENGTH] > 0.0, 1, 1] += 0.001 * len(scenes)
    return predicted


def at_random() -> Spoil:
    random = np.random.default_rng(0)

    def spoil(scenes: Scenes, pushes: Pushes, predicted: Scenes) -> Scenes:
        predicted[pushes[:, LENGTH] > 0.0, 1, 1] += random.normal()
        return predicted

    return spoil


def test_a_model_that_keeps_the_contract_passes():
    check_dynamics(Shifting(lambda scenes, pushes, predicted: predicted))
    check_dynamics(IdentityPrior())


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda s, a, p: p[:, :1], "step predicted scenes of shape"),
        (lambda s, a, p: p[:, ::-1].copy(), "disks must stay in their order"),
        (lambda s, a, p: p * np.nan, "step predicts NaN or Inf"),
        (lambda s, a, p: 2 * p, "other masses or radii"),
        (moving, "step predicts disks that still move"),
        (lambda s, a, p: p + np.eye(8)[0], "changes the scene of a push of length 0"),
        (at_random(), "step predicts something else when asked again"),
        (in_place, "step changes its arguments"),
        (by_batch, "step predicts something else for a push alone than in a batch"),
    ],
)
def test_a_rule_that_is_broken_is_named(spoil, message):
    assert any(message in line for line in violations(Shifting(spoil)))
    with pytest.raises(ModelUnavailableError, match=r"not keep the contract:\n  \* 2 disks"):
        check_dynamics(Shifting(spoil))
