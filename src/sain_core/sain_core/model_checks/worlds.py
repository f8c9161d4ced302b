"""Whether a world keeps the contract of docs/guides/your_world.md: for tests of a package.

from sain_core.model_checks.worlds import check_world, two_disks
check_world(load("my_world"), two_disks(), PUSH)
"""

from typing import TypeVar

import numpy as np

from sain_core.errors import SainError
from sain_core.push import LENGTH
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray, Scene
from sain_core.world import AnyWorld, Setting, WorldFailedError, check_outcome

Start = TypeVar("Start")

AS_PUT = 1e-9  # [m, rad], by which the first scene may differ from the one that was asked for


def two_disks() -> Setting:
    """Return a setting that any world has: a mid disk, and the target beyond it on the x axis."""
    places, masses, radii = np.array([(0.45, 0.0), (0.60, 0.0)]), np.full(2, 8.0), (0.08, 0.06)
    scene = make_scene(places, masses, np.array(radii))
    return Setting(scene, Bodies.disks(2), 0.12)


def check_world(world: AnyWorld[Start], start: Start, push: PushArray) -> Scene:
    """Check that a world keeps the contract, by a push that it can execute; return where it led.

    Raises:
        WorldFailedError: what it does not keep.
    """
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
