"""A history that grows by one push costs the inference of one push."""

from collections.abc import Callable

import numpy as np

from sain_core.history import PushHistory
from sain_core.types import Pushes, Scenes
from sain_model.compute.latest_pushes import LatestPushes
from sain_model.physics.friction import FrictionFilter
from sain_model.physics.planar import PlanarPrior

Draw = Callable[[int, int], tuple[Scenes, Pushes]]
PRIOR = PlanarPrior()


def history(draw: Draw, pushes: int) -> PushHistory:
    scenes, actions = draw(pushes, 5)
    return PushHistory(
        scenes, actions, PRIOR.step(scenes, actions, {"friction": np.full(pushes, 0.2)})
    )


def test_only_new_pushes_are_computed_and_only_the_latest_history_is_kept(
    random_pushes: Draw,
) -> None:
    past, asked = history(random_pushes, 6), []

    def compute(scenes: Scenes, pushes: Pushes, after: Scenes) -> np.ndarray:
        asked.append(len(pushes))
        return np.column_stack([pushes.sum(axis=1), after[:, 0, 0]])

    latest, whole = LatestPushes(), compute(past.state, past.action, past.next_state)
    asked.clear()
    for rows, new in (
        (slice(0, 3), [3]),
        (slice(0, 4), [1]),
        (slice(1, 6), [2]),
        (slice(1, 6), []),
        (slice(0, 6), [1]),  # the first one was dropped
        (slice(0, 0), [0]),
        (slice(0, 6), [6]),
    ):
        asked.clear()
        np.testing.assert_array_equal(latest.rows(past.select(rows), compute), whole[rows])
        assert asked == new


def test_friction_inferred_push_by_push_is_friction_inferred_at_once(random_pushes: Draw) -> None:
    past, at_once = history(random_pushes, 5), FrictionFilter(PRIOR, PRIOR.config.friction)
    growing = FrictionFilter(PRIOR, PRIOR.config.friction)
    for count in range(6):
        belief = growing.infer(past.select(slice(0, count)))
    assert belief.weights.tobytes() == at_once.infer(past).weights.tobytes()


def test_what_is_remembered_is_of_one_physics(random_pushes: Draw) -> None:
    past = history(random_pushes, 3)
    first, other = PRIOR.condition(past), PRIOR.at(0.1).condition(past)
    assert PRIOR.condition(past) == first
    assert PRIOR.at(0.1).condition(past) == other
    assert PlanarPrior().filter() is PRIOR.filter() is not PRIOR.at(0.1).filter()
