"""Results as data: a record for each scene and tolerance, their summary, and the files of both."""

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from math import isnan
from pathlib import Path
from typing import Any, Final, get_type_hints

import numpy as np

from sain_core.config import typed
from sain_core.output import write_whole
from sain_core.provenance import DISTRIBUTION, git_commit, processor, system, versions
from sain_core.randomness import Interval, bootstrap_mean, generator
from sain_core.scene import POSITION, THETA, wrap_angle
from sain_core.transitions import MOVED
from sain_core.types import Scene
from sain_core.world import PushRecord, ToppledError
from sain_eval.episode import EpisodeRecord, Tolerance
from sain_eval.loop.play import EpisodeOutcome
from sain_eval.scenes.families import ScenarioScene
from sain_eval.scenes.scenarios import SCENARIOS

TURNED: Final = 0.02  # [rad], as little as `MOVED` at the rim of a body of 0.1 m
SCHEMA: Final = "sain-results-1"
RESULTS_FILE: Final = "results.json"
JOURNAL_FILE: Final = "episodes.jsonl"
RESULT_FILES: Final = (RESULTS_FILE, JOURNAL_FILE)
PACKAGES: Final = ("numpy", "scipy", "numba", "torch", "pybullet", DISTRIBUTION)


@dataclass(frozen=True)
class SceneRecord:
    """What a controller made of one scene at one tolerance."""

    scenario: str
    seed: int
    controller: str
    tolerance: float  # [m]
    success: bool  # settled within the tolerance, everything on the table, in time
    pushes: int  # until then, or all that were made
    final_distance: float  # [m], then or at the end; of several poses the largest
    target_errors: tuple[float, ...]  # [m], of predictions; see `_prediction_error`
    refusals: int
    failure: str  # empty for a success
    fallbacks: int = 0  # pushes that physics planned because the model failed
    heading_tolerance: float = 0.0  # [rad]
    has_heading: bool = False  # whether the goal asks for one
    final_turn: float = 0.0  # [rad], as the distance
    turn_errors: tuple[float, ...] = ()  # [rad], as `target_errors`
    plan_seconds: tuple[float, ...] = ()  # of each push
    shapes: tuple[str, ...] = ()  # of the bodies
    goals: int = 1  # reached in a row, where a scene has several
    most_goals: int = 1  # that the scene has
    within: str = ""  # what counts as success, where it is not the tolerance
    seconds: float = 0.0  # of the world, that these pushes took
    version: str = ""  # of the controller's model or policy, such as its SHA-256

    @property
    def tipped(self) -> bool:
        """Whether it failed because a push tipped a body over."""
        return self.failure.startswith(ToppledError.__name__)

    @property
    def group(self) -> tuple[str, str, float, float]:
        """What is summarised together."""
        return self.scenario, self.controller, self.tolerance, self.heading_tolerance

    @property
    def episode(self) -> tuple[str, int, str]:
        """What no two episodes of an evaluation share."""
        return self.scenario, self.seed, self.controller

    @property
    def place(self) -> int:
        """The number of the scenario in the order of all; after these, if it is none of them."""
        names = list(SCENARIOS)
        return names.index(self.scenario) if self.scenario in names else len(names)


def scene_records(
    case: ScenarioScene,
    controller: str,
    outcome: EpisodeOutcome,
    tolerances: Sequence[Tolerance | float],
) -> list[SceneRecord]:
    """Judge one episode at several tolerances, each as if it had ended when it was met.

    A number is a distance [m].
    """
    return [_judged(case, controller, outcome, Tolerance.of(one)) for one in tolerances]


def _judged(
    case: ScenarioScene, controller: str, outcome: EpisodeOutcome, tolerance: Tolerance
) -> SceneRecord:
    made: list[PushRecord] = []
    goals, first = 0, outcome.records[0]
    judged = first.judge(first.start)
    for episode in outcome.records:
        reached = episode.pushes_to(tolerance)
        count = len(episode.pushes) if reached is None else reached
        made += episode.pushes[:count]
        judged = episode.judge(episode.scenes[count])
        if reached is None:
            break
        goals += 1
    success = goals == len(case.goals)
    errors = [e for push in made if (e := _prediction_error(push, outcome.record)) is not None]
    return SceneRecord(
        scenario=case.scenario,
        seed=case.seed,
        controller=controller,
        tolerance=tolerance.distance,
        success=success,
        pushes=len(made),
        final_distance=judged.distance,
        target_errors=tuple(distance for distance, _ in errors),
        refusals=outcome.refusals,
        failure="" if success else outcome.failure or "not within this tolerance",
        fallbacks=outcome.fallbacks,
        heading_tolerance=tolerance.turn,
        has_heading=case.goal.has_heading,
        final_turn=judged.turn,
        turn_errors=tuple(turn for _, turn in errors),
        plan_seconds=tuple(push.planning_time for push in made),
        shapes=case.shapes,
        goals=goals,
        most_goals=len(case.goals),
        within=case.success,
        seconds=sum(push.duration for push in made),
    )


def _prediction_error(push: PushRecord, episode: EpisodeRecord) -> tuple[float, float] | None:
    """Return the largest distance [m] and turn [rad] of wanted bodies from their prediction.

    None for a push that moves none of them, in truth and as predicted: to predict that is easy,
    and a model that moves nothing would seem to be good.
    """
    if push.predicted is None:
        return None
    ways = (_apart(scene, push.before, episode) for scene in (push.after, push.predicted))
    if all(far <= MOVED and turned <= TURNED for far, turned in ways):
        return None
    return _apart(push.predicted, push.after, episode)


def _apart(one: Scene, other: Scene, episode: EpisodeRecord) -> tuple[float, float]:
    """Return the largest distance [m] and turn [rad] of wanted bodies between two scenes.

    The turn of a disk shows nowhere and does not count.
    """
    rows = list(episode.goal.wanted)
    off = one[rows] - other[rows]
    turned = [not episode.bodies.shapes[body].is_round for body in rows]
    turns = np.where(turned, np.abs(wrap_angle(off[:, THETA])), 0.0)
    return float(np.hypot(*off[:, POSITION].T).max()), float(turns.max())


def summarise(records: Sequence[SceneRecord]) -> list[dict[str, Any]]:
    """Return one row for each scenario, controller and tolerance, in that order.

    Scenarios have the order of `SCENARIOS`.
    """
    ordered = sorted(records, key=lambda record: (record.place, *record.group, record.seed))
    return [_row(list(group)) for _, group in groupby(ordered, key=lambda record: record.group)]


def _row(records: list[SceneRecord]) -> dict[str, Any]:
    solved = [record for record in records if record.success]
    first, turned = records[0], any(record.has_heading for record in records)
    random = generator(0, "bootstrap", *map(str, first.group))
    errors = [error for record in records for error in record.target_errors]
    turns = [error for record in records if turned for error in record.turn_errors]
    times = [time for record in records for time in record.plan_seconds if time > 0.0]
    return {
        "scenario": first.scenario,
        "controller": first.controller,
        "tolerance": first.tolerance,
        "heading_tolerance": first.heading_tolerance if turned else 0.0,
        "within": first.within or None,
        "scenes": len(records),
        "successes": len(solved),
        "rate": interval_row(wilson_interval(len(solved), len(records))),
        "pushes": interval_row(bootstrap_mean(np.array([float(r.pushes) for r in solved]), random)),
        "seconds": float(np.mean([record.seconds for record in records])),
        "planning_median": float(np.median(times)) if times else None,
        "planning_p95": float(np.quantile(times, 0.95)) if times else None,
        "target_error": float(np.mean(errors)) if errors else None,
        "turn_error": float(np.mean(turns)) if turns else None,
        "refusals": sum(record.refusals for record in records),
        "tipped": sum(record.tipped for record in records),
        "fallbacks": sum(record.fallbacks for record in records),
        "goals_in_a_row": [record.goals for record in records if record.most_goals > 1],
        "most_goals": first.most_goals,
    }


def wilson_interval(successes: int, trials: int) -> Interval:
    """Return a success rate with its 95 % Wilson score interval (Wilson 1927, eq. 6 ff.).

    Unlike the normal one it is right for rates near 0 and 1 and for few trials.
    """
    from scipy.stats import binomtest  # takes half a second to import

    low, high = binomtest(successes, trials).proportion_ci(0.95, "wilson")
    return Interval(successes / trials, float(low), float(high))


def interval_row(interval: Interval) -> dict[str, float | None]:
    """Return an interval with None for NaN, which JSON does not have."""
    return {name: None if isnan(v) else v for name, v in interval._asdict().items()}


def write_results(
    folder: Path, records: Sequence[SceneRecord], config: dict[str, Any], command: str
) -> Path:
    """Write `results.json`: records, summary, and what it takes to make them again."""
    content = {
        "schema": SCHEMA,
        "command": command,
        "config": config,
        "git_commit": git_commit(),
        "versions": versions(*PACKAGES),
        "machine": {"cpu": processor(), "system": system()},
        "summary": summarise(records),
        "scenes": [dataclasses.asdict(record) for record in records],
    }
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"
    return write_whole(folder / RESULTS_FILE, text.encode())


def record_of(item: dict[str, Any]) -> SceneRecord:
    """Return a record from its JSON; raises `TypeError` or `LookupError`: it is none."""
    right = get_type_hints(SceneRecord)
    return SceneRecord(**{name: typed(name, right[name], value) for name, value in item.items()})
