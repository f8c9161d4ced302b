"""The pushes of an episode as the page shows them: what was expected of each, and what came."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from sain_bags.report.drawn import as_json, rounded_places
from sain_bags.report.frames import Frame
from sain_bags.report.gathering import Gathered
from sain_bags.rows.episodes import Episode
from sain_bags.rows.results import RecordedPush
from sain_core.errors import ErrorCode
from sain_core.push import PUSH_NAMES, pushed_bodies
from sain_core.scene import POSE, POSITION, TARGET
from sain_core.types import Scene
from sain_core.view.scenes import predictions, push_arrow
from sain_core.view.things import Look, Thing

DIGITS: Final = 8  # of metres and radians: what the page rounds again stays what it was

Moments = tuple[int | None, int | None]  # the frames between which a push happened; None: unknown


def rounded(value: float | None, digits: int = DIGITS) -> float | None:
    """Return a number for JSON, which has no NaN."""
    if value is None or not np.isfinite(value):
        return None
    return round(float(value), digits)


def poses(scene: Scene | None) -> list[list[float]] | None:
    """Return where the disks are: x, y [m] and theta [rad] of each."""
    if scene is None or not np.isfinite(scene[:, POSE]).all():
        return None
    return rounded_places(scene[:, POSE])


def describe_pushes(gathered: Gathered, frames: Sequence[Frame]) -> list[dict[str, Any]]:
    """Return the pushes of an episode, in the order of their results."""
    found = []
    for push in gathered.episode.pushes:
        moments = _moments(frames, push)
        if not push.executed:
            moments = (moments[0], moments[0])
        found.append(_describe(push, gathered, moments))
    return found


def _moments(frames: Sequence[Frame], push: RecordedPush) -> Moments:
    """Find the frames at rest before and after a push, by scene id, else by stamp."""
    at_rest = {frame.scene_id: number for number, frame in enumerate(frames) if frame.settled}
    before = [number for number, frame in enumerate(frames) if frame.stamp <= push.stamps[0]]
    after = [number for number, frame in enumerate(frames) if frame.stamp >= push.stamps[1]]
    first = at_rest.get(push.scene_ids[0], before[-1] if before else None)
    last = at_rest.get(push.scene_ids[1], after[0] if after else None)
    if first is not None and last is not None and last < first:
        last = first
    return first, last


def _describe(push: RecordedPush, gathered: Gathered, moments: Moments) -> dict[str, Any]:
    episode = gathered.episode
    plan, actual = push.plan, push.after if push.executed else None
    return {
        "id": str(push.push_id),  # may be beyond what a number of JavaScript can hold
        "outcome": "executed" if push.executed else "refused",
        "reason": _reason(push),
        "message": push.error_message,
        "source": push.source,
        "model": plan.dynamics if plan else "",
        "fallback": bool(plan and plan.fallback),
        "planning": rounded(plan.planning_time if plan else None),
        "body": int(pushed_bodies(push.push)),
        **{name: rounded(push.push[PUSH_NAMES.index(name)]) for name in PUSH_NAMES[1:]},
        "duration": rounded(push.duration, 3),
        "from": moments[0],
        "to": moments[1],
        "things": _things(push, actual, gathered),
        "physicsModel": push.physics_model,
        "expectedError": rounded(target_error(push.predicted, actual, episode.aimed)),
        "physicsError": rounded(target_error(push.physics, actual, episode.aimed)),
        "moved": rounded(target_error(push.before, actual, episode.aimed)),
        "distance": [_distance(scene, episode) for scene in (push.before, actual)],
    }


def _things(push: RecordedPush, actual: Scene | None, gathered: Gathered) -> list[dict[str, Any]]:
    """Return what is drawn of a push: the predictions of both models, and the tool's way."""
    things: list[Thing] = []
    if push.executed:
        known = ((push.physics, Look.PHYSICS), (push.predicted, Look.EXPECTED))
        for scene, look in ((scene, look) for scene, look in known if scene is not None):
            bodies = gathered.bodies(len(scene))
            things += predictions(push.before, actual, scene, bodies, look)
    if push.before is not None:
        things += push_arrow(push.before, push.push, gathered.bodies(len(push.before)))
    return [as_json(thing) for thing in things]


def _reason(push: RecordedPush) -> str:
    names = {int(code): code.name.lower().replace("_", " ") for code in ErrorCode}
    return "" if push.executed else names.get(push.error_code, str(push.error_code))


def target_error(one: Scene | None, other: Scene | None, body: int = TARGET) -> float | None:
    """Return how far the target, or another body, is from where the other scene has it [m]."""
    if one is None or other is None or one.shape != other.shape or body >= len(one):
        return None
    return float(np.linalg.norm(one[body, POSITION] - other[body, POSITION]))


def models(pushes: Sequence[RecordedPush]) -> dict[str, list[str]]:
    """Return the names of the models that predicted these pushes."""
    return {
        "models": sorted({push.plan.dynamics for push in pushes if push.plan}),
        "physicsModels": sorted({push.physics_model for push in pushes if push.physics_model}),
    }


def _distance(scene: Scene | None, episode: Episode) -> float | None:
    if scene is None or episode.goal is None:
        return None
    return rounded(episode.distance(scene))
