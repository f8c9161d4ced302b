"""Another reader of bags, with `rosbags` and nothing of ours: what the rows of a bag should be.

It keeps the whole bag in memory and pairs by ids alone. By hand, beside a converted data set:

    python -m tests.sain_bags.independent BAG DATASET
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader

OK = 1
NAMES = ("x", "y", "theta", "vx", "vy", "omega", "mass", "radius")


def independent_rows(folder: Path) -> Iterator[dict[str, Any]]:
    """Yield what should become of a bag's executed pushes, in the order of their results.

    Where no model predicted a push, its row has no `physics_next` and no `physics_source`.
    """
    results, goals = read(folder)
    for number, (result, time) in results.items():
        push, predicted = result.push, result.prediction
        row = {
            **scene_fields(result.before, result.after),
            "action": [push.body, push.location, push.angle, push.length, push.speed or 0.2],
            "duration": result.duration,
            **goal_fields(goals.get(result.episode_id) or goals.get(0), len(result.before.disks)),
            "shapes": ",".join(["disk"] * len(result.before.disks)),
            "roles": ",".join(["pushable"] + ["movable"] * (len(result.before.disks) - 1)),
            "friction": np.nan,
            "rim_friction": np.nan,
            "tool_friction": np.nan,
            "push_id": number,
            "bag_episode": result.episode_id,
            "outcome": OK,
            "log_time": time,
            "source": "push_result",
        }
        if predicted.error_code == OK:
            row |= {"physics_next": numbers(predicted.disks), "physics_source": predicted.model}
        yield row


def compare(rows: Mapping[str, Any], folder: Path) -> int:
    """Compare rows, a column each, with what the bag should become; return how many fields.

    Raises:
        AssertionError: a field of a row differs, or a row is missing or too much.
    """
    expected = list(independent_rows(folder))
    count = len(rows["push_id"])
    assert count == len(expected), f"{count} rows, not {len(expected)}"
    compared = 0
    for place, row in enumerate(expected):
        for name, value in row.items():
            np.testing.assert_array_equal(
                np.asarray(rows[name][place]), np.asarray(value), f"{name} of row {place}"
            )
            compared += 1
    return compared


def read(folder: Path) -> tuple[dict[int, tuple[Any, int]], dict[int, Any]]:
    """Return the first result of each executed push, with when it came, and goals by episode."""
    results: dict[int, tuple[Any, int]] = {}
    goals: dict[int, Any] = {}
    with AnyReader([folder]) as reader:
        wanted = [c for c in reader.connections if c.msgtype.endswith(("/PushResult", "/Goal"))]
        for connection, time, raw in reader.messages(wanted):
            message = reader.deserialize(raw, connection.msgtype)
            if connection.msgtype.endswith("/Goal"):
                goals[message.episode_id] = message
            elif message.error_code == OK:
                results.setdefault(message.push_id, (message, time))
    return results, goals


def scene_fields(before: Any, after: Any) -> dict[str, Any]:
    """Return what a row has of the two scenes."""
    way = (after.disks[1].x - before.disks[1].x, after.disks[1].y - before.disks[1].y)
    return {
        "state": numbers(before.disks),
        "next_state": numbers(after.disks),
        "masses": [disk.mass for disk in before.disks],
        "radii": [disk.radius for disk in before.disks],
        "moved": np.hypot(*way) >= 0.002,
        "bag_scene": before.scene_id,
        "stamp": stamp(before),
        "next_stamp": stamp(after),
    }


def goal_fields(goal: Any, count: int) -> dict[str, Any]:
    """Return what a row has of its goal, in a scene of so many bodies; NaN: not asked."""
    poses, tolerances = np.full((count, 3), np.nan), np.full((count, 2), np.nan)
    keep = np.full(count, np.nan)
    for pose in goal.poses if goal else ():
        body = 0 if count == 1 else pose.body  # a single body is the target
        poses[body, :2], tolerances[body, 0] = (pose.x, pose.y), pose.tolerance
        if pose.has_heading:
            poses[body, 2], tolerances[body, 1] = pose.heading, pose.heading_tolerance
    for body in goal.keep if goal else ():
        keep[body] = goal.keep_tolerance
    flat = {"goal_poses": poses.ravel(), "goal_tolerances": tolerances.ravel()}
    return {**flat, "goal_keep": keep}


def numbers(disks: Sequence[Any]) -> list[float]:
    """Return the state of disks, one after the other."""
    return [getattr(disk, name) for disk in disks for name in NAMES]


def stamp(scene: Any) -> int:
    """Return a scene's simulated time [ns]."""
    return int(scene.header.stamp.sec) * 10**9 + int(scene.header.stamp.nanosec)


def shards(folder: Path) -> dict[str, Any]:
    """Return the columns of all npz shards of a data set, with one number of disks, as one."""
    parts = [dict(np.load(path)) for path in sorted(folder.glob("shard-*.npz"))]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


if __name__ == "__main__":
    print(compare(shards(Path(sys.argv[2])), Path(sys.argv[1])), "fields are equal")
