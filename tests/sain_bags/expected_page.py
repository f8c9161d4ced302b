"""What a person should read in the page of a bag, computed with `rosbags` and nothing of ours."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader

from tests.sain_bags.independent import OK
from tests.sain_bags.shown import recorded

UNKNOWN = "–"
SCALES = {"mm": 1e3, "ms": 1e3, "s": 1.0, "°": 180 / math.pi, "Hz": 1.0, "kB": 1e-3, "": 1.0}
FIGURE = re.compile(r"^(−?[\d,]+(?:\.(\d+))?)\s*(\D*)$")


def assert_shows(text: str, value: float | None, name: str = "") -> None:
    """Assert that a text shows a value in SI units, rounded to the digits that it shows."""
    if value is None:
        assert text == UNKNOWN, f"{name} is {text!r}, but nothing is known of it"
        return
    found = FIGURE.match(text)
    assert found, f"{name} is {text!r}, which is no figure"
    number, digits = float(found[1].replace("−", "-").replace(",", "")), len(found[2] or "")
    expected = value * SCALES[found[3]]
    assert abs(number - expected) <= 0.5 * 10**-digits + 1e-6, f"{name}: {text!r}, not {expected}"


@dataclass(frozen=True)
class ExpectedEpisode:
    """One episode: a row for each push, and where the target came to rest."""

    rows: list[dict[str, float | None]]
    executed: int
    refused: int
    distance: float | None  # [m], from target to goal at the end


def expected_episodes(folder: Path) -> dict[int, ExpectedEpisode]:
    """Return what the page should show of each episode that has a result of a push."""
    found = recorded(folder)
    goals = {goal.episode_id: goal.poses[0] for goal in found.get("goal", [])}
    plans: dict[int, Any] = {}
    for plan in found.get("plan", []):
        plans.setdefault(plan.push_id, plan)
    results: dict[int, list[Any]] = {}
    for result in found.get("push_result", []):
        results.setdefault(result.episode_id, []).append(result)
    return {
        number: ExpectedEpisode(
            [_row(one, goals[number], plans) for one in every],
            sum(one.error_code == OK for one in every),
            sum(one.error_code != OK for one in every),
            _apart(every[-1].after.disks[1], goals[number]),
        )
        for number, every in results.items()
    }


def _row(result: Any, goal: Any, plans: Mapping[int, Any]) -> dict[str, float | None]:
    plan, other, done = plans[result.push_id], result.prediction, result.error_code == OK
    before, after = result.before.disks[1], result.after.disks[1]
    first = plan.predicted.reshape(plan.horizon, plan.disks, 8)[0, 1]
    return {
        "Tool at": result.push.location,
        "Direction": result.push.angle,
        "Travel": result.push.length,
        "Target moved": _apart(before, after) if done else None,
        "Target to goal": _apart(after, goal) if done else None,
        "Physics error": _apart(other.disks[1], after) if done and other.model else None,
        "Planner error": math.hypot(first[0] - after.x, first[1] - after.y) if done else None,
        "Planning time": plan.planning_time,
    }


def _apart(one: Any, other: Any) -> float:
    return math.hypot(one.x - other.x, one.y - other.y)


@dataclass(frozen=True)
class ExpectedTopic:
    """The messages of one topic."""

    messages: int
    rate: float | None  # [Hz]
    gap: float | None  # [s]


def expected_topics(folder: Path) -> dict[str, ExpectedTopic]:
    """Return what the page should show of each topic."""
    times: dict[str, list[int]] = {}
    with AnyReader([folder]) as reader:
        for connection, time, _ in reader.messages():
            times.setdefault(connection.topic, []).append(time)
    return {
        name: ExpectedTopic(
            len(every),
            (len(every) - 1) * 1e9 / (every[-1] - every[0]) if len(every) > 1 else None,
            1e-9 * float(np.diff(every).max()) if len(every) > 1 else None,
        )
        for name, every in times.items()
    }
