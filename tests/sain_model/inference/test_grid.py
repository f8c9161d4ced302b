"""What pushes say about friction on a grid: those of their own episode, and nothing to come."""

from collections.abc import Callable

import numpy as np
import pytest

from sain_core.push import mirror_pushes
from sain_core.scene import POSITION, mirror_scenes
from sain_core.transitions import PushHistory
from sain_core.types import Pushes, Scenes
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference import evidence as grid
from sain_model.inference.evidence import Known, ObservedPushes, marginals
from sain_model.inference.kinds import FRICTION, Kind, friction_belief
from sain_model.physics.planar import PlanarPrior

Draw = Callable[[int, int], tuple[Scenes, Pushes]]
PRIOR = PlanarPrior()
KIND = Kind("planar", PRIOR)
EPISODES, PUSHES = 12, 5
FRICTIONS = np.repeat(np.geomspace(0.05, 0.3, EPISODES), PUSHES)
EPISODE = np.repeat(np.arange(EPISODES), PUSHES)
STEP = np.tile(np.arange(PUSHES), EPISODES)


@pytest.fixture
def planar():
    return SainDynamics(friction_belief(PRIOR))


def history(draw: Draw, truth: float, pushes: int = PUSHES, noise: float = 0.0) -> PushHistory:
    scenes, actions = draw(pushes, 5)
    after = PRIOR.step(scenes, actions, {FRICTION: np.full(pushes, truth)})
    after[..., POSITION] += np.random.default_rng(1).normal(0, noise, after[..., POSITION].shape)
    return PushHistory(scenes, actions, after)


def world(draw: Draw) -> ObservedPushes:
    scenes, pushes = draw(EPISODES * PUSHES, 6)
    after = PRIOR.step(scenes, pushes, {FRICTION: FRICTIONS})
    return ObservedPushes(scenes, pushes, after, EPISODE)


def friction(curves: grid.Curves, known: Known) -> np.ndarray:
    return KIND.values(marginals(KIND, known.total(curves)).places)[FRICTION]


@pytest.mark.parametrize("truth", [0.035, 0.12, 0.38])
def test_a_few_pushes_show_the_friction_also_outside_the_default_range(
    planar, random_pushes, truth
):
    conditioned = planar.condition(history(random_pushes, truth, noise=2e-4))
    assert conditioned.value(FRICTION) == pytest.approx(truth, rel=0.06)
    assert conditioned.spread(FRICTION) < 0.1


def test_the_order_of_pushes_and_a_mirror_change_nothing(planar, random_pushes):
    past = history(random_pushes, 0.17, noise=5e-4)
    truth = planar.condition(past).value(FRICTION)
    turned = past.select(slice(None, None, -1))
    assert planar.condition(turned).value(FRICTION) == pytest.approx(truth, rel=1e-9)
    mirrored = PushHistory(
        mirror_scenes(past.state), mirror_pushes(past.action), mirror_scenes(past.next_state)
    )
    assert planar.condition(mirrored).value(FRICTION) == pytest.approx(truth, rel=1e-3)


def test_one_push_that_no_friction_explains_does_not_decide(planar, random_pushes):
    past = history(random_pushes, 0.17, pushes=8)
    wrong = past.next_state.copy()
    wrong[3, :, POSITION] += 0.05
    found = planar.condition(PushHistory(past.state, past.action, wrong)).value(FRICTION)
    assert found == pytest.approx(0.17, rel=0.05)


@pytest.mark.parametrize("hindsight", [False, True])
def test_a_push_is_predicted_without_itself_what_comes_and_other_episodes(random_pushes, hindsight):
    """With hindsight, as in training, later pushes of the episode count, too."""
    known = Known.others(EPISODE) if hindsight else Known.earlier(EPISODE, STEP)
    curves, row = grid.curves_of(KIND, world(random_pushes)), 3 * PUSHES + 2
    truth, changed = friction(curves, known), curves.copy()
    unseen = (EPISODE[row] != EPISODE) | (STEP[row] == STEP)
    unseen |= (STEP[row] < STEP) & (not hindsight)
    changed[unseen] = np.random.default_rng(0).normal(0, 30, changed[unseen].shape)
    found = friction(changed, known)
    assert found[row] == pytest.approx(truth[row], rel=1e-9)
    assert found[row + 1] != pytest.approx(truth[row + 1], rel=1e-3)
