"""An episode as the page's script reads it: frames, pushes, plans and what came of it."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from sain_bags.report.drawn import as_json
from sain_bags.report.frames import Frame, frame_times
from sain_bags.report.gathering import Gathered
from sain_bags.report.pushes import describe_pushes, models, poses, rounded
from sain_bags.rows.episodes import Episode
from sain_core.scene import MASS, POSE
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene
from sain_core.view.scenes import bodies_in, goal_marks

STATUS: Final = ("unknown", "push", "reached", "no push", "exhausted")  # sain_interfaces/msg/Plan
KINDS: Final = ("physics", "expected")  # of predictions
PUSHES: Final = 300  # of one episode that are shown


def describe_episode(gathered: Gathered, title: str, start: int) -> dict[str, Any]:
    """Return an episode for the page; the start of the recording is in [ns since the epoch]."""
    episode = gathered.episode
    frames = gathered.frames
    replaced = not frames
    if replaced:
        frames = _from_pushes(gathered)
    pushes = describe_pushes(gathered, frames)
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
            if scene is None or (found and _same(found[-1], scene)):
                continue
            found.append(Frame(stamp, 0, number, True, scene))
    return tuple(found) or (Frame(0, 0, 0, True, gathered.episode.start),)


def _same(frame: Frame, scene: np.ndarray) -> bool:
    return frame.scene.shape == scene.shape and np.array_equal(frame.scene[:, POSE], scene[:, POSE])
