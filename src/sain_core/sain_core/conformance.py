"""Whether models and worlds keep their contracts: for tests of a package.

from sain_core.conformance import check_dynamics, check_world, two_disks
check_dynamics(load("my_model"))
check_world(load("my_world"), two_disks(), PUSH)
"""

from collections.abc import Iterator
from typing import Final, TypeVar

import numpy as np

from sain_core.errors import ModelUnavailableError, SainError
from sain_core.model import Model, check_rollout, check_step
from sain_core.push import LENGTH, PushLimits
from sain_core.scene import POSE, THETA, is_settled, make_scene, unit, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.transitions import PushHistory
from sain_core.types import PushArray, Pushes, Scene, Scenes
from sain_core.world import AnyWorld, Setting, WorldFailedError, check_outcome

TOLERANCE: Final = 1e-5  # [m, rad], between a batch and its single pushes, rollout and steps
PUSHES: Final = 12
HORIZON: Final = 3


def check_dynamics(model: Model, disks: tuple[int, ...] = (2, 3)) -> None:
    """Check that a model keeps the contract, by predictions of random pushes of so many disks.

    Raises `ModelUnavailableError`, which names all that it does not keep.
    """
    broken = [line for count in disks for line in violations(model, count)]
    if broken:
        text = "".join(f"\n  * {line}" for line in dict.fromkeys(broken))
        raise ModelUnavailableError(f"{type(model).__name__} does not keep the contract:{text}")


def violations(model: Model, disks: int = 2) -> list[str]:
    """Return one sentence for each part of the contract that a model does not keep."""
    scenes, pushes = sample_pushes(PUSHES, disks)
    try:
        predicted = check_step(model.step(scenes.copy(), pushes.copy()), scenes, "step")
        broken = [
            *_step_violations(model, scenes, pushes, predicted),
            *_rollout_violations(model, scenes, pushes),
            *_history_violations(model, scenes, pushes, predicted),
        ]
    except SainError as error:
        return [f"{disks} disks: {error}"]
    return [f"{disks} disks: {line}" for line in broken]


def sample_pushes(count: int, disks: int) -> tuple[Scenes, Pushes]:
    """Return settled scenes (count, N, 8) of a mid disk with others about it, and pushes.

    Masses and radii all differ, so that an exchange of two disks shows. The last push has no
    length.
    """
    random = np.random.default_rng(0)
    masses, radii = 7.5 + 0.25 * np.arange(disks), 0.080 - 0.004 * np.arange(disks)
    scenes = []
    for bearing in random.uniform(-np.pi, np.pi, count):
        about = bearing + 2.0 * np.pi * np.arange(disks - 1) / max(disks - 1, 1)
        apart = (radii[0] + radii[1:] + 0.002 + 0.25 * (disks > 4))[:, None]
        middle = np.array([[0.5, 0.0]])
        places = np.concatenate([middle, middle + apart * unit(about)])
        scenes.append(make_scene(places, masses, radii, random.uniform(-3.0, 3.0, disks)))
    pushes = PushLimits().sample(random, count)
    pushes[-1, LENGTH] = 0.0
    return np.stack(scenes), pushes


def _step_violations(
    model: Model, scenes: Scenes, pushes: Pushes, predicted: Scenes
) -> Iterator[str]:
    if predicted.dtype != np.float64:
        yield f"step returns {predicted.dtype}; it must return float64"
    if not is_settled(predicted).all():
        yield "step predicts disks that still move; a prediction is a settled scene"
    if not np.array_equal(predicted[-1], scenes[-1]):
        yield "step changes the scene of a push of length 0; every bit must stay"
    given = scenes.copy(), pushes.copy()
    again = model.step(*given)
    if not np.array_equal(again, predicted):
        yield "step predicts something else when asked again; it must be deterministic"
    if not (np.array_equal(given[0], scenes) and np.array_equal(given[1], pushes)):
        yield "step changes its arguments; it must leave them as they are"
    alone = np.concatenate([model.step(scenes[[i]], pushes[[i]]) for i in range(len(pushes))])
    if _apart(alone, predicted) > TOLERANCE:
        yield "step predicts something else for a push alone than in a batch"


def _rollout_violations(model: Model, scenes: Scenes, pushes: Pushes) -> Iterator[str]:
    sequences = pushes.reshape(-1, HORIZON, pushes.shape[-1])
    scene = scenes[0]
    predicted = check_rollout(model.rollout(scene, sequences), scene, sequences, "rollout")
    if _apart(predicted, Model.rollout(model, scene, sequences)) > TOLERANCE:
        yield "rollout predicts something else than step, push after push"
    radii = model.regions(scene, sequences, predicted)
    if radii is not None and (radii.shape != predicted.shape[:3] or not (radii >= 0.0).all()):
        yield "regions returns radii that are negative, NaN or not of shape (K, H, N)"


def _history_violations(
    model: Model, scenes: Scenes, pushes: Pushes, predicted: Scenes
) -> Iterator[str]:
    default = model.condition(PushHistory.empty(scenes.shape[1])).step(scenes, pushes)
    if not np.array_equal(default, predicted):
        yield "condition without pushes predicts something else than the model itself"
    conditioned = model.condition(PushHistory(scenes[:2], pushes[:2], predicted[:2]))
    check_step(conditioned.step(scenes, pushes), scenes, "step after condition")
    if not np.array_equal(model.step(scenes, pushes), predicted):
        yield "condition changes the model itself; it must return another one"


def _apart(ones: Scenes, others: Scenes) -> float:
    """Return the largest difference of two poses [m, rad]."""
    difference = (ones - others)[..., POSE]
    difference[..., THETA] = wrap_angle(difference[..., THETA])
    return float(np.abs(difference).max())


Start = TypeVar("Start")

AS_PUT = 1e-9  # [m, rad], by which the first scene may differ from the one that was asked for


def two_disks() -> Setting:
    """Return a setting that any world has: a mid disk, and the target beyond it on the x axis."""
    places, masses, radii = np.array([(0.45, 0.0), (0.60, 0.0)]), np.full(2, 8.0), (0.08, 0.06)
    scene = make_scene(places, masses, np.array(radii))
    return Setting(scene, Bodies.disks(2), 0.12)


def check_world(world: AnyWorld[Start], start: Start, push: PushArray) -> Scene:
    """Check that a world keeps the contract, by a push that it can execute; return where it led."""
    first = _observed(world, world.reset(start))
    if isinstance(start, Setting) and not np.allclose(first, start.scene, rtol=0.0, atol=AS_PUT):
        raise WorldFailedError("the first scene is not the one of the setting")
    idle = push.copy()
    idle[LENGTH] = 0.0
    if world.push(idle).after.tobytes() != first.tobytes():
        raise WorldFailedError("a push of length 0 changed the scene")
    after = _pushed(world, first, push)
    again = _pushed(world, _observed(world, world.reset(start)), push)
    if after.tobytes() != again.tobytes():
        raise WorldFailedError("the same push from the same start led elsewhere")
    return after


def _pushed(world: AnyWorld[Start], before: Scene, push: PushArray) -> Scene:
    """Return where a push leads from a scene (N, 8)."""
    given = push.copy()
    try:
        outcome = world.push(given)
    except SainError as error:
        raise WorldFailedError(f"the push was refused: {error}") from error
    if given.tobytes() != push.tobytes():
        raise WorldFailedError("the push that was given was changed")
    if outcome.before.tobytes() != before.tobytes():
        raise WorldFailedError("the outcome's scene before the push is not the one there was")
    return _observed(world, check_outcome(before, outcome.after))


def _observed(world: AnyWorld[Start], returned: Scene) -> Scene:
    """Return a scene (N, 8) that a method returned, if the world shows the same."""
    if returned.tobytes() != world.observe().tobytes():
        raise WorldFailedError("observe returns another scene than reset or push")
    scene = returned.copy()
    returned += 1.0
    if world.observe().tobytes() != scene.tobytes():
        raise WorldFailedError("who writes into a scene that it returned changes the world")
    return scene
