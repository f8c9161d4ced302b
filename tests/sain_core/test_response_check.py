import re

import numpy as np
import pytest

from sain_core.errors import ModelUnavailableError, OutOfRangeError
from sain_core.model import (
    answering,
    check_rollout,
    check_step,
)
from sain_core.push import idle_pushes
from sain_core.scene import MASS, make_scene

SCENE = make_scene(np.array([(0.4, 0.0), (0.6, 0.0)]), np.array([8.0, 7.5]), np.array([0.08, 0.06]))
SCENES = np.stack([SCENE] * 3)
SEQUENCES = idle_pushes(3, 4)
PREDICTED = np.broadcast_to(SCENE, (3, 4, 2, 8)).copy()


def spoilt(predicted: np.ndarray, column: int, value: float) -> np.ndarray:
    other = predicted.copy()
    other[1, ..., 1, column] = value
    return other


def test_an_answer_that_can_be_one_is_returned() -> None:
    assert check_step(SCENES, SCENES) is SCENES
    assert check_rollout(PREDICTED, SCENE, SEQUENCES) is PREDICTED


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (None, "model 'x' returned a NoneType; it must return a NumPy array"),
        (SCENES.tolist(), "model 'x' returned a list; it must return a NumPy array"),
        (SCENES[:2], "predicted scenes of shape (2, 2, 8); the shape must be (3, 2, 8)"),
        (SCENES[..., :6], "predicted scenes of shape (3, 2, 6); the shape must be (3, 2, 8)"),
        (spoilt(SCENES, 0, np.nan), "model 'x' predicts NaN or Inf in 1 of 48 numbers"),
        (spoilt(SCENES, MASS, 7.0), "model 'x' predicted disks of other masses or radii"),
        (SCENES[:, ::-1], "disks must stay in their order"),
    ],
)
def test_a_step_that_cannot_be_an_answer_is_refused(answer: object, message: str) -> None:
    with pytest.raises(ModelUnavailableError, match=re.escape(message)):
        check_step(answer, SCENES, "model 'x'")


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (
            PREDICTED[:, :3],
            "of shape (3, 3, 2, 8); the shape must be (3, 4, 2, 8)",
        ),
        (spoilt(PREDICTED, MASS, 7.0), "predicted disks of other masses or radii"),
    ],
)
def test_a_rollout_that_cannot_be_an_answer_is_refused(answer: object, message: str) -> None:
    with pytest.raises(ModelUnavailableError, match=re.escape(message)):
        check_rollout(answer, SCENE, SEQUENCES)


def test_a_search_gets_sequences_that_are_not_finite_and_others_may_refuse_them() -> None:
    predicted = np.full_like(PREDICTED, np.nan)
    assert check_rollout(predicted, SCENE, SEQUENCES, finite=False) is predicted
    with pytest.raises(ModelUnavailableError, match="the model predicts NaN or Inf in 192 of 192"):
        check_rollout(predicted, SCENE, SEQUENCES)


def test_what_a_model_raises_names_the_model() -> None:
    message = "model 'x' failed: KeyError: 'friction'"
    with pytest.raises(ModelUnavailableError, match=message), answering("model 'x'"):
        raise KeyError("friction")
    with pytest.raises(OutOfRangeError), answering("model 'x'"):
        raise OutOfRangeError("a push that is too long")
