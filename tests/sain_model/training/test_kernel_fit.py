"""A kernel on few pushes of bodies: it gains where physics leaves something, and harms nowhere."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import CheckpointError
from sain_core.push import START_X, pushed_bodies
from sain_model.data.dataset import Dataset, Split, split_by_episode
from sain_model.dynamics.identify import infer_bodies, with_beliefs
from sain_model.dynamics.load import ModelCard, save_checkpoint
from sain_model.dynamics.sain import residual_model, weights_of
from sain_model.evaluation.errors import position_errors, predict_known
from sain_model.inference.kinds import surface_kind
from sain_model.training.fit import Parent
from sain_model.training.kernel_fit import fit_kernel
from sain_model.training.settings import OF_BODIES
from tests.benchmarks.real.synthetic import write_pushes

FAR = 10.0  # [m], from all pushes that were learned from
BEND = 0.12  # [rad], of what physics leaves
MOST_HARM, LEAST_GAIN = 1.01, 0.7  # ratios of errors to those of physics


@pytest.fixture(scope="module")
def learned(tmp_path_factory):
    data = write_pushes(tmp_path_factory.mktemp("pushes"), count=40)
    split = split_by_episode(data, 0, 0.3, 0.0)
    return split, infer_bodies(replace(surface_kind(), corrected=True), split.train)


def bent(data: Dataset) -> Dataset:
    """Return pushes that move bodies farther to the left."""
    parts = []
    for part in data.parts:
        move, after = part.next_state - part.state, part.next_state.copy()
        after[..., 0] -= BEND * move[..., 1]
        after[..., 1] += BEND * move[..., 0]
        parts.append(replace(part, next_state=after))
    return replace(data, parts=tuple(parts))


def ratio(split: Split, bodies) -> tuple[float, float, object]:
    """Return the held-out error of SAIN over that of its physics, and what was learned."""
    weights, history = fit_kernel(with_beliefs(split.train, bodies), bodies.kind, OF_BODIES)
    sain = residual_model(weights, bodies.kind, "planar")
    before, after = (
        np.concatenate(
            [
                position_errors(
                    predict_known(sain, part, bodies, corrected).mean,
                    part.next_state,
                    pushed_bodies(part.action),
                )
                for part in split.validation.parts
            ]
        ).mean()
        for corrected in (False, True)
    )
    return after / before, history.best, sain


def test_a_kernel_does_no_harm_where_physics_is_right(learned):
    split, bodies = learned
    assert ratio(split, bodies)[0] < MOST_HARM


def test_a_kernel_learns_what_physics_leaves(learned, tmp_path):
    split, bodies = learned
    both = Split(bent(split.train), bent(split.validation), split.test)
    gained, best, sain = ratio(both, bodies)
    assert gained < LEAST_GAIN and best == 0
    part = both.validation.parts[0]
    far = replace(part, state=part.state.copy(), action=part.action.copy())
    far.state[..., 0] += FAR
    far.action[:, START_X] += FAR
    plain, corrected = (predict_known(sain, far, bodies, way).mean for way in (False, True))
    np.testing.assert_allclose(corrected, plain, atol=1e-9)
    path = tmp_path / "kernel.safetensors"
    save_checkpoint(path, weights_of(sain), ModelCard("planar", {}, {}, kind="residual"))
    with pytest.raises(CheckpointError, match="a kernel on few pushes"):
        Parent.load(str(path))
