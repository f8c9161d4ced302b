"""What earlier pushes show of a model's errors, and what they must not show."""

import numpy as np
import pytest

from sain_core.model import load_dynamics
from sain_core.push import BODY, LENGTH, make_stroke
from sain_core.scene import POSITION, RADIUS, THETA, make_scene, turned, unit
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import PushHistory
from sain_model.dynamics.memory import Memory
from sain_model.inference.evidence import ObservedPushes
from sain_model.physics.parameters import AXES
from sain_model.physics.planar import PlanarPrior

BODIES = Bodies.named(["square", "square"])
PRIOR = PlanarPrior(bodies=BODIES)


def pushed(count, error, seed=0, noise=0.0):
    """Return pushes of body 0 whose errors are shares (B, 3) of the predicted way in its frame."""
    random = np.random.default_rng(seed)
    scene = make_scene(np.array([(0.5, 0.0), (0.9, 0.3)]), np.full(2, 1.0), np.full(2, 0.05))
    states = np.repeat(scene[None], count, axis=0)
    states[:, 0, THETA] = random.uniform(-3.0, 3.0, count)
    heading = states[:, 0, THETA] + random.uniform(-0.5, 0.5, count)
    aside = random.uniform(-0.02, 0.02, (count, 1)) * unit(heading + np.pi / 2)
    start = states[:, 0, POSITION] - 0.08 * unit(heading) + aside
    strokes = make_stroke(start, heading, 0.08, speed=0.1, tip_radius=0.005)
    after = PRIOR.step(states, strokes)
    truth, way = after.copy(), np.linalg.norm((after - states)[:, 0, POSITION], axis=-1)
    off = way[:, None] * error(heading - states[:, 0, THETA], aside) + noise * random.normal(
        size=(count, 2)
    )
    truth[:, 0, POSITION] += turned(off, states[:, 0, THETA])
    return ObservedPushes(states, strokes, truth, np.zeros(count, np.int64), BODIES), after


def smooth(heading, aside):
    """Return errors that like pushes have in common."""
    return 0.15 * np.column_stack([np.sin(2.0 * heading), np.cos(3.0 * heading)])


def nothing(heading, aside):
    return np.zeros((len(heading), 2))


def off(pushes, after):
    return np.linalg.norm((after - pushes.next_state)[:, 0, POSITION], axis=-1)


def test_errors_that_like_pushes_have_in_common_are_taken_away():
    known, after = pushed(30, smooth, noise=0.0005)
    memory = Memory.of(known, after)
    new, predicted = pushed(60, smooth, seed=1)
    corrected = memory.correct(new.state, new.action, predicted, BODIES)
    assert off(new, corrected).mean() < 0.5 * off(new, predicted).mean()
    np.testing.assert_array_equal(corrected[:, 1], predicted[:, 1])
    alone = np.concatenate(
        [memory.correct(new.state[[i]], new.action[[i]], predicted[[i]], BODIES) for i in range(9)]
    )
    np.testing.assert_array_equal(alone, corrected[:9])


@pytest.mark.parametrize("count", [2, 5, 15, 40])
def test_noise_and_outliers_are_no_errors_of_the_model(count):
    worst = []
    for seed in range(8):
        known, after = pushed(count, nothing, seed=2 * seed, noise=0.001)
        known.next_state[0, 0, POSITION] += 0.05
        memory = Memory.of(known, after)
        new, predicted = pushed(50, nothing, seed=2 * seed + 1, noise=0.001)
        if memory is not None:
            predicted = memory.correct(new.state, new.action, predicted, BODIES)
        worst.append(
            off(new, predicted).mean()
            / off(new, pushed(50, nothing, 2 * seed + 1, 0.001)[1]).mean()
        )
    assert np.mean(worst) < 1.03


def test_other_bodies_and_idle_pushes_stay_as_they_are():
    known, after = pushed(30, smooth)
    memory = Memory.of(known, after)
    new, predicted = pushed(10, smooth, seed=1)
    idle = new.action.copy()
    idle[:, LENGTH] = 0.0
    same = memory.correct(new.state, idle, new.state, BODIES)
    np.testing.assert_allclose(same, new.state, atol=1e-12)
    other = new.action.copy()
    other[:, BODY] = 1.0
    swapped = memory.correct(new.state, other, predicted, BODIES)
    np.testing.assert_allclose(swapped, predicted, atol=1e-12)


def test_exact_predictions_leave_nothing_to_learn():
    known, after = pushed(20, nothing)
    assert Memory.of(known, after) is None and Memory.of(known.select(slice(1)), after[:1]) is None
    assert known.state[0, 0, RADIUS] > 0.0


def test_rollouts_of_disks_are_corrected_too(random_pushes):
    scenes, pushes = random_pushes(30, 5)
    after = PlanarPrior(AXES).step(scenes, pushes)
    rows = np.arange(30), pushes[:, BODY].astype(int)
    x, y = (after - scenes)[rows][:, POSITION].T
    after[(*rows, POSITION)] += 0.3 * np.column_stack([-y, x])
    model = load_dynamics("sain").condition(PushHistory(scenes, pushes, after))
    assert model.now.memories[0] is not None
    rolled = model.rollout(scenes[0], pushes[:8, None])
    stepped = model.step(np.repeat(scenes[:1], 8, axis=0), pushes[:8])
    np.testing.assert_array_equal(rolled[:, 0], stepped)
