"""An episode as the page's script reads it: frames, pushes, plans and what came of it."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from sain_bags.report.drawn import as_json, rounded_places
from sain_bags.report.gathering import Frame, Gathered, frame_times
from sain_bags.rows.episodes import Episode
from sain_bags.rows.results import RecordedPush
from sain_core.errors import ErrorCode
from sain_core.push import PUSH_NAMES, pushed_bodies
from sain_core.scene import MASS, POSE, POSITION, TARGET
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene
from sain_core.view.scenes import bodies_in, goal_marks, predictions, push_arrow
from sain_core.view.things import Look, Thing

STATUS: Final = ("unknown", "push", "reached", "no push", "exhausted")  # sain_interfaces/msg/Plan
KINDS: Final = ("physics", "expected")  # of predictions
PUSHES: Final = 300  # of one episode that are shown
DIGITS: Final = 8  # of metres and radians: what the page rounds again stays what it was

Moments = tuple[int | None, int | None]  # the frames between which a push happened; None: unknown


def describe_episode(gathered: Gathered, title: str, start: int) -> dict[str, Any]:
    """Return an episode for the page; the start of the recording is in [ns since the epoch]."""
    episode = gathered.episode
    frames = gathered.frames
    replaced = not frames
    if replaced:
        frames = _from_pushes(gathered)
    pushes = [_push(push, gathered, frames) for push in episode.pushes]
    pushes.sort(key=lambda push: push["from"] or 0)
    shown = pushes[:PUSHES]
    if len(shown) < len(pushes) and shown[-1]["to"] is not None:
        frames = frames[: shown[-1]["to"] + 1]
    first = frames[0].scene if frames else episode.start
    bodies = gathered.bodies(len(first))
    return {
        "number": episode.episode_id,
        "title": title,
        "outcome": outcome(episode),
        "aimed": episode.aimed,
        "poses": _poses(episode),
        "keep": _keep(episode),
        "tolerance": rounded(episode.goal.tolerance if episode.goal else None),
        "distance": rounded(episode.distance(episode.final)),
        "maxPushes": episode.max_pushes,
        "start": rounded(1e-9 * (episode.interval[0] - start), 3),
        "end": rounded(1e-9 * (episode.interval[1] - start), 3),
        "turn": _turn(episode),
        "disks": _disks(first, gathered, bodies),
        "goals": [as_json(mark) for mark in goal_marks(episode.goal, first, bodies)],
        "frames": _frames(frames, gathered, replaced, len(pushes) > len(shown)),
        "pushes": shown,
        "counts": _counts(pushes),
        "series": _series(pushes, episode),
        "verdicts": _verdicts(episode),
    }


def outcome(episode: Episode) -> str:
    """Return how an episode ended, in the page's words."""
    if episode.goal is None:
        return "no goal"
    return "reached" if episode.success else "not reached"


def _turn(episode: Episode) -> float | None:
    """Return the largest turn [rad] from a heading at the end; None: none is asked for."""
    judged = episode.judge(episode.final)
    return rounded(judged.turn) if judged is not None and judged.goal.has_heading else None


def _poses(episode: Episode) -> list[dict[str, Any]]:
    """Return where bodies should come to rest."""
    poses = episode.goal.poses if episode.goal else ()
    return [{"body": pose.body, "x": rounded(pose.x), "y": rounded(pose.y)} for pose in poses]


def _keep(episode: Episode) -> list[dict[str, Any]]:
    """Return the bodies to be kept, by how far they may be moved and were [m]."""
    judged = episode.judge(episode.final)
    if judged is None:
        return []
    tolerance = rounded(judged.goal.keep_tolerance)
    return [
        {"body": body, "tolerance": tolerance, "moved": rounded(way)}
        for body, way in zip(judged.goal.keep, judged.ways.tolist(), strict=False)
    ]


def _disks(scene: Scene, gathered: Gathered, bodies: Bodies) -> list[dict[str, Any]]:
    """Return each body as it is drawn first; with its shape and role if the recording has them."""
    stated = bodies is gathered.episode.bodies
    return [
        as_json(body)
        | {"mass": rounded(body.state[MASS], 3)}
        | ({"name": body.shape.name, "role": str(bodies.roles[body.number])} if stated else {})
        for body in bodies_in(scene, bodies, gathered.episode.goal)
    ]


def _counts(pushes: Sequence[dict[str, Any]]) -> dict[str, int]:
    outcomes = [push["outcome"] for push in pushes]
    return {word: outcomes.count(word) for word in ("executed", "refused")}


def _series(pushes: Sequence[dict[str, Any]], episode: Episode) -> dict[str, Any]:
    """Return which predictions the chart of errors shows, and the models that made them."""
    known = {kind: any(push[f"{kind}Error"] is not None for push in pushes) for kind in KINDS}
    return {**known, **models(episode.pushes)}


def _verdicts(episode: Episode) -> list[dict[str, Any]]:
    """Return the decisions of the planner that sent no push: the last words of it."""
    return [
        {
            "status": STATUS[plan.status] if plan.status < len(STATUS) else str(plan.status),
            "message": plan.error_message,
            "planning": rounded(plan.planning_time),
        }
        for plan in episode.plans
        if not plan.push_id
    ][-3:]


def _frames(
    frames: Sequence[Frame], gathered: Gathered, replaced: bool, cut: bool
) -> dict[str, Any]:
    return {
        "time": [round(float(time), 4) for time in frame_times(frames)],
        "poses": [poses(frame.scene) for frame in frames],
        "settled": [int(frame.settled) for frame in frames],
        "recorded": gathered.shown.recorded,
        "thinned": gathered.shown.stride,
        "unusable": gathered.shown.unusable,
        "fromPushes": replaced,
        "cut": cut,
    }


def _from_pushes(gathered: Gathered) -> tuple[Frame, ...]:
    """Return the scenes before and after pushes, where scenes themselves were not recorded."""
    found: list[Frame] = []
    for push in gathered.episode.executed:
        scenes = (push.before, push.after)
        for scene, number, stamp in zip(scenes, push.scene_ids, push.stamps, strict=True):
            if not len(scene) or (found and _same(found[-1], scene)):
                continue
            found.append(Frame(stamp, 0, number, True, scene))
    return tuple(found) or (Frame(0, 0, 0, True, gathered.episode.start),)


def _same(frame: Frame, scene: np.ndarray) -> bool:
    return frame.scene.shape == scene.shape and np.array_equal(frame.scene[:, POSE], scene[:, POSE])


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


def _push(push: RecordedPush, gathered: Gathered, frames: Sequence[Frame]) -> dict[str, Any]:
    """Return a push: what was expected of it, and what came."""
    episode, (first, last) = gathered.episode, _moments(frames, push)
    plan, actual = push.plan, push.after if push.executed and len(push.after) else None
    return {
        "id": str(push.push_id),  # may be beyond what a number of JavaScript can hold
        "outcome": "executed" if push.executed else "refused",
        "reason": _reason(push),
        "message": push.message,
        "source": push.source,
        "model": plan.dynamics if plan else "",
        "fallback": bool(plan and plan.fallback),
        "planning": rounded(plan.planning_time if plan else None),
        "body": int(pushed_bodies(push.push)),
        **{name: rounded(push.push[PUSH_NAMES.index(name)]) for name in PUSH_NAMES[1:]},
        "duration": rounded(push.duration, 3),
        "from": first,
        "to": last if push.executed else first,
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
    if len(push.before):
        things += push_arrow(push.before, push.push, gathered.bodies(len(push.before)))
    return [as_json(thing) for thing in things]


def _reason(push: RecordedPush) -> str:
    names = {int(code): code.name.lower().replace("_", " ") for code in ErrorCode}
    return "" if push.executed else names.get(push.code, str(push.code))


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
    if scene is None or not len(scene) or episode.goal is None:
        return None
    return rounded(episode.distance(scene))
