"""Results as data: one record a scene and tolerance, and their summary with intervals."""

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from math import isnan
from pathlib import Path
from typing import Any, Final

import numpy as np

from sain_core.bootstrap import Interval, bootstrap_mean
from sain_core.dataset import MOVED
from sain_core.provenance import git_commit, processor, system, versions
from sain_core.scene import MID, POSITION, THETA, wrap_angle
from sain_core.seeding import generator
from sain_core.storage import write_whole
from sain_core.types import Scene
from sain_core.world import PushRecord
from sain_eval.loop.closed_loop import EpisodeOutcome
from sain_eval.loop.statistics import wilson_interval
from sain_eval.plots.episode_record import EpisodeRecord
from sain_eval.scenes.scenario_scene import ScenarioScene
from sain_eval.scenes.scenarios import SCENARIOS
from sain_eval.tolerance import Tolerance

TURNED: Final = 0.02  # [rad], as little as `MOVED` at the rim of a body of 0.1 m
SCHEMA: Final = "sain-results-1"
RESULTS_FILE: Final = "results.json"
PACKAGES: Final = ("numpy", "scipy", "numba", "torch", "pybullet", "sain_core")


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
    planning_seconds: float  # mean of the pushes
    target_errors: tuple[float, ...]  # [m], of the model's prediction, one for each push
    mid_errors: tuple[float, ...]  # [m]; none where it has a pose itself
    refusals: int
    failure: str  # empty for a success
    fallbacks: int = 0  # pushes that physics planned because the model failed
    heading_tolerance: float = 0.0  # [rad]
    has_heading: bool = False  # whether the goal asks for one
    final_turn: float = 0.0  # [rad], as the distance
    turn_errors: tuple[float, ...] = ()  # [rad], of the model's prediction
    plan_seconds: tuple[float, ...] = ()  # of each push
    shapes: tuple[str, ...] = ()  # of the bodies
    goals: int = 1  # reached in a row, where a scene has several
    most_goals: int = 1  # that the scene has

    @property
    def group(self) -> tuple[str, str, float, float]:
        """What is summarised together."""
        return self.scenario, self.controller, self.tolerance, self.heading_tolerance

    @property
    def place(self) -> int:
        """The number of the scenario in the order of all; after these, if it is none of them."""
        return (
            list(SCENARIOS).index(self.scenario) if self.scenario in SCENARIOS else len(SCENARIOS)
        )


def scene_records(
    case: ScenarioScene,
    controller: str,
    outcome: EpisodeOutcome,
    tolerances: Sequence[Tolerance | float],
) -> list[SceneRecord]:
    """Judge one episode at several tolerances, each as if it had ended when it was met.

    A number is a distance [m].
    """
    return [_judge(case, controller, outcome, Tolerance.of(one)) for one in tolerances]


def _judge(
    case: ScenarioScene, controller: str, outcome: EpisodeOutcome, tolerance: Tolerance
) -> SceneRecord:
    made: list[PushRecord] = []
    goals, judged = 0, outcome.records[0].judge(outcome.records[0].start)
    for episode in outcome.records:
        reached = episode.pushes_to(tolerance)
        count = len(episode.pushes) if reached is None else reached
        made += episode.pushes[:count]
        judged = episode.judge(episode.scenes[count])
        if reached is None:
            break
        goals += 1
    success = goals == len(case.goals)
    times = [push.planning_time for push in made]
    errors = [_prediction_error(push, outcome.record) for push in made]
    known = [error for error in errors if error is not None]
    mid = [e for push in made if (e := push.error(MID)) is not None]
    return SceneRecord(
        scenario=case.scenario,
        seed=case.seed,
        controller=controller,
        tolerance=tolerance.distance,
        success=success,
        pushes=len(made),
        final_distance=judged.distance,
        planning_seconds=float(np.mean(times)) if times else 0.0,
        target_errors=tuple(distance for distance, _ in known),
        mid_errors=() if MID in case.goal.wanted else tuple(mid),
        refusals=outcome.refusals,
        failure="" if success else outcome.failure or "not within this tolerance",
        fallbacks=outcome.fallbacks,
        heading_tolerance=tolerance.turn,
        has_heading=case.goal.has_heading,
        final_turn=judged.turn,
        turn_errors=tuple(turn for _, turn in known),
        plan_seconds=tuple(times),
        shapes=case.shapes,
        goals=goals,
        most_goals=len(case.goals),
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
    mid_errors = [error for record in records for error in record.mid_errors]
    times = [time for record in records for time in record.plan_seconds if time > 0.0]
    return {
        "scenario": first.scenario,
        "controller": first.controller,
        "tolerance": first.tolerance,
        "heading_tolerance": first.heading_tolerance if turned else 0.0,
        "scenes": len(records),
        "successes": len(solved),
        "rate": interval_row(wilson_interval(len(solved), len(records))),
        "pushes": interval_row(bootstrap_mean(np.array([float(r.pushes) for r in solved]), random)),
        "final_distance": _mean([record.final_distance for record in records]),
        "final_turn": _mean([record.final_turn for record in records]),
        "planning_seconds": _mean([record.planning_seconds for record in records]),
        "planning_median": _quantile(times, 0.5),
        "planning_p95": _quantile(times, 0.95),
        "target_error": _mean(errors),
        "turn_error": _mean([e for r in records if turned for e in r.turn_errors]),
        "mid_error": _mean(mid_errors),
        "refusals": sum(record.refusals for record in records),
        "fallbacks": sum(record.fallbacks for record in records),
        "goals": _mean([float(record.goals) for record in records]),
        "goals_in_a_row": [record.goals for record in records if record.most_goals > 1],
        "most_goals": first.most_goals,
    }


def interval_row(interval: Interval) -> dict[str, float | None]:
    """Return an interval with None for NaN, which JSON does not have."""
    return {name: None if isnan(v) else v for name, v in interval._asdict().items()}


def _mean(values: list[float]) -> float | None:
    return float(np.mean(values)) if values else None


def _quantile(values: list[float], share: float) -> float | None:
    return float(np.quantile(values, share)) if values else None


def how_it_was_made(
    config: dict[str, Any], command: str, packages: Sequence[str]
) -> dict[str, Any]:
    """Return the beginning of results: all it takes to make them again."""
    return {
        "schema": SCHEMA,
        "command": command,
        "config": config,
        "git_commit": git_commit(),
        "versions": versions(*packages),
        "machine": {"cpu": processor(), "system": system()},
    }


def write_results(
    folder: Path, records: Sequence[SceneRecord], config: dict[str, Any], command: str
) -> Path:
    """Write `results.json`: records, summary, and what it takes to make them again."""
    content = {
        **how_it_was_made(config, command, PACKAGES),
        "summary": summarise(records),
        "scenes": [dataclasses.asdict(record) for record in records],
    }
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"
    return write_whole(folder / RESULTS_FILE, text.encode())
