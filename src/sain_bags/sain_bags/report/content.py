"""All that a page shows of a bag, as one structure that JSON can hold."""

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any, Final

import numpy as np

from sain_bags.reading.reader import Bag
from sain_bags.reading.timing import BINS, TopicTiming, read_timings
from sain_bags.report.drawn import as_json
from sain_bags.report.episode_content import (
    describe_episode,
    models,
    outcome,
    rounded,
    target_error,
)
from sain_bags.report.gathering import (
    Gathered,
    Limits,
    Progress,
    episode_titles,
    gather,
    graphs,
)
from sain_core.errors import DatasetError, InvalidInputError
from sain_core.view.scenes import stage
from sain_core.wire.learning import Learned, LearnedCurve, decode_learning

STEPS: Final = 200  # of the curve of errors
HISTOGRAM: Final = 24  # bars
LEARNING: Final = "sain_interfaces/msg/Learning"


def describe_learning(bag: Bag) -> dict[str, Any] | None:
    """Return the curves and events of a learner; None: there was none."""
    latest = deque(bag.messages(types=(LEARNING,)), maxlen=1)
    for last in latest:
        try:
            return learned_json(decode_learning(last.message))
        except InvalidInputError as error:
            raise DatasetError(f"{bag.path}: {last.topic}: {error}") from error
    return None


def learned_json(learned: Learned) -> dict[str, Any]:
    """Return what was learned."""
    return {
        "laboratory": learned.laboratory,
        "service": learned.service,
        "pushes": learned.pushes,
        "errors": [_curve(one) for one in learned.errors],
        "parameters": [_curve(one) for one in learned.parameters],
        "events": [list(event) for event in learned.events],
    }


def _curve(curve: LearnedCurve) -> dict[str, Any]:
    rows = [[rounded(number, 6) for number in row] for row in curve.values.tolist()]
    return {"name": curve.name, "unit": curve.unit, "pushes": curve.pushes.tolist(), "rows": rows}


@dataclass(frozen=True)
class Content:
    """What goes into the page."""

    data: dict[str, Any]
    episodes: int
    pushes: int


def read_content(bag: Bag, limits: Limits = Limits(), progress: Progress = lambda: None) -> Content:
    """Read a whole bag, comparing each chunk with its CRC, for its page.

    `progress` is called for each message of an episode. A bag without episodes still has topics.

    Raises:
        DatasetError: damage, or messages that make no sense.
    """
    timings = read_timings(bag)
    recorded = [one for name in graphs(bag) for one in gather(bag, name, limits, progress)]
    titles = episode_titles(bag, [one.part for one in recorded])
    idle = [one.idle for one in recorded]
    if all(idle):  # then there is nothing else to show
        idle = [False] * len(recorded)
    kept = [not one for one in idle]
    found, found_titles = list(compress(recorded, kept)), compress(titles, kept)
    shown = found[: limits.episodes]
    data = {
        "bag": _facts(bag),
        "custom": sorted(bag.custom_data.items()),
        "notice": _notice(bag, found),
        "idle": _idle_text(list(compress(titles, idle))),
        "bins": BINS,
        "topics": [
            {
                "name": topic.name,
                "type": topic.type,
                **_timing(timings[topic.name, topic.type], bag.start),
            }
            for topic in bag.topics
        ],
        "stage": [as_json(thing) for thing in stage()],
        "view": _view(shown),
        "totals": _totals(found),
        "episodes": [
            describe_episode(one, title, bag.start)
            for one, title in zip(shown, found_titles, strict=False)
        ],
        "planning": _planning(found),
        "errors": _errors(found),
        "learning": describe_learning(bag),
    }
    pushes = sum(len(one.episode.executed) for one in found)
    return Content(data, len(found), pushes)


def _facts(bag: Bag) -> dict[str, Any]:
    seconds, nanoseconds = divmod(bag.start, 10**9)
    began = time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(seconds))
    path = bag.path.resolve()
    return {
        "name": path.parent.name if path.name == "bag" else path.name,
        "path": str(path),
        "began": f"{began} UTC" if bag.message_count else "",
        "nanoseconds": nanoseconds,
        "duration": rounded(bag.duration, 3),
        "messages": bag.message_count,
        "size": bag.size,
        "crcs": bag.has_crcs,
    }


def _timing(timing: TopicTiming, start: int) -> dict[str, Any]:
    """Return when a topic's messages came; times are seconds from the start of the recording."""
    return {
        "messages": timing.messages,
        "rate": timing.rate,
        "counts": timing.counts,
        "gap": timing.longest_gap,
        "gapStart": 1e-9 * (timing.gap_start - start) if timing.longest_gap else 0.0,
        "missing": timing.missing,
        "latest": timing.latest,
        "places": [[1e-9 * (time - start), count] for time, count in timing.places],
    }


def _idle_text(titles: Sequence[str]) -> str:
    """Say which episodes are left out because nothing happened in them."""
    if not titles:
        return ""
    are = "has" if len(titles) == 1 else "have"
    return f"Not shown: {', '.join(titles)}, which {are} no goal, no push and no motion."


def _notice(bag: Bag, found: Sequence[Gathered]) -> str:
    """Say what is missing in a recording in which no push was executed."""
    pushes = [push for one in found for push in one.episode.pushes]
    if not bag.message_count:
        return "This recording has no messages."
    if not found:
        return "This recording has no scenes and no pushes. The page shows its topics."
    if any(push.executed for push in pushes) or any(one.episode.unanswered for one in found):
        return ""
    if pushes:
        return f"No push was executed in this recording: {len(pushes)} refused."
    return "This recording has no pushes. The page shows its scenes and its topics."


def _view(found: Sequence[Gathered]) -> list[float]:
    """Return the part of the world that is in view, x and y from and to [m]: all that happened."""
    points = [np.array([[-0.07, 0.0], [0.75, -0.30], [0.75, 0.30]])]
    for one in found:
        scenes = [frame.scene for frame in one.frames] or [one.episode.start, one.episode.final]
        for scene in scenes:
            points += [scene[:, :2] - scene[:, 7:], scene[:, :2] + scene[:, 7:]]
        if one.episode.goal is not None:
            places = one.episode.goal.places
            points += [places - 0.03, places + 0.03]
    every = np.clip(np.concatenate(points), -5.0, 5.0)
    (left, bottom), (right, top) = every.min(axis=0) - 0.05, every.max(axis=0) + 0.05
    return [round(float(value), 3) for value in (left, right, bottom, top)]


def _totals(found: Sequence[Gathered]) -> dict[str, int]:
    episodes = [one.episode for one in found]
    outcomes = [outcome(episode) for episode in episodes]
    pushes = [push for episode in episodes for push in episode.pushes]
    executed = sum(push.executed for push in pushes)
    return {
        "episodes": sum(one.goal == 1 for one in found),
        "withGoal": len(outcomes) - outcomes.count("no goal"),
        "reached": outcomes.count("reached"),
        "executed": executed,
        "refused": len(pushes) - executed,
        "unanswered": sum(episode.unanswered for episode in episodes),
        "fallbacks": sum(plan.fallback for episode in episodes for plan in episode.plans),
    }


def _planning(found: Sequence[Gathered]) -> dict[str, Any] | None:
    """Return how long the plans that sent a push took, as a histogram."""
    plans = [plan for one in found for plan in one.episode.plans if plan.push_id]
    times = np.array([plan.planning_time for plan in plans], dtype=np.float64)
    times = times[np.isfinite(times)]
    if not len(times):
        return None
    top = float(times.max())
    counts, edges = np.histogram(times, bins=HISTOGRAM, range=(0.0, _above(top)))
    return {
        "counts": counts.tolist(),
        "edges": [rounded(edge, 6) for edge in edges],
        "plans": len(times),
        "median": rounded(float(np.median(times))),
        "p95": rounded(float(np.percentile(times, 95))),
        "longest": rounded(top),
    }


def _above(value: float) -> float:
    """Return the next larger round number, at least 1 ms."""
    power = 10.0 ** np.floor(np.log10(max(value, 1e-3)))
    for factor in (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0):
        if factor * power >= value:
            return float(factor * power)
    return value


def _errors(found: Sequence[Gathered]) -> dict[str, Any]:
    """Return the errors of the predicted targets over all executed pushes, by predictor."""
    made = [(one.episode.aimed, push) for one in found for push in one.episode.executed]
    pushes = [push for _, push in made]
    return {
        "expected": _distribution([target_error(p.predicted, p.after, body) for body, p in made]),
        "physics": _distribution([target_error(p.physics, p.after, body) for body, p in made]),
        **models(pushes),
    }


def _distribution(errors: Sequence[float | None]) -> dict[str, Any] | None:
    known = np.array([error for error in errors if error is not None], dtype=np.float64)
    if not len(known):
        return None
    known.sort()
    places = np.unique(np.linspace(0, len(known) - 1, STEPS).round().astype(int))
    return {
        "pushes": len(known),
        "median": rounded(float(np.median(known))),
        "sorted": [rounded(float(error)) for error in known[places]],
        "shares": [round(float(place + 1) / len(known), 4) for place in places],
    }
