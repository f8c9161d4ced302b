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

from sain_core.provenance import git_commit, processor, system, versions
from sain_core.scene import target_distance
from sain_core.seeding import generator
from sain_core.storage import write_whole
from sain_eval.loop.closed_loop import EpisodeOutcome
from sain_eval.loop.statistics import Interval, bootstrap_mean, wilson_interval
from sain_eval.scenes.scenarios import ScenarioScene
from sain_model.evaluation.markdown import markdown_table

SCHEMA: Final = "sain-results-1"
RESULTS_FILE: Final = "results.json"
PACKAGES: Final = ("numpy", "scipy", "numba", "torch", "pybullet", "sain_core")

HEADER: Final = (
    "scenario",
    "controller",
    "within",
    "solved",
    "95 % interval",
    "pushes",
    "prediction error",
    "planning",
)


@dataclass(frozen=True)
class SceneRecord:
    """What a controller made of one scene at one tolerance."""

    scenario: str
    seed: int
    controller: str
    tolerance: float  # [m]
    success: bool  # settled within the tolerance, everything on the table, in time
    pushes: int  # until then, or all that were made
    final_distance: float  # [m], target to goal then, or at the end
    planning_seconds: float  # mean of the pushes
    target_errors: tuple[float, ...]  # [m], of the model's prediction, one for each push
    mid_errors: tuple[float, ...]  # [m]
    refusals: int
    failure: str  # empty for a success
    fallbacks: int = 0  # pushes that physics planned because the model failed

    @property
    def group(self) -> tuple[str, str, float]:
        """What is summarised together."""
        return self.scenario, self.controller, self.tolerance


def scene_records(
    case: ScenarioScene, controller: str, outcome: EpisodeOutcome, tolerances: Sequence[float]
) -> list[SceneRecord]:
    """Judge one episode at several tolerances [m], each as if it had ended when it was met."""
    return [_judge(case, controller, outcome, tolerance) for tolerance in tolerances]


def _judge(
    case: ScenarioScene, controller: str, outcome: EpisodeOutcome, tolerance: float
) -> SceneRecord:
    episode = outcome.record
    reached = episode.pushes_to(tolerance)
    count = len(episode.pushes) if reached is None else reached
    made = episode.pushes[:count]
    times = [push.planning_time for push in made]
    return SceneRecord(
        scenario=case.scenario,
        seed=case.seed,
        controller=controller,
        tolerance=tolerance,
        success=reached is not None,
        pushes=count,
        final_distance=float(target_distance(episode.scenes[count], episode.goal)),
        planning_seconds=float(np.mean(times)) if times else 0.0,
        target_errors=tuple(e for push in made if (e := push.target_error) is not None),
        mid_errors=tuple(e for push in made if (e := push.mid_error) is not None),
        refusals=outcome.refusals,
        failure="" if reached is not None else outcome.failure,
        fallbacks=outcome.fallbacks,
    )


def summarise(records: Sequence[SceneRecord]) -> list[dict[str, Any]]:
    """Return one row for each scenario, controller and tolerance, in that order."""
    ordered = sorted(records, key=lambda record: (*record.group, record.seed))
    return [_row(list(group)) for _, group in groupby(ordered, key=lambda record: record.group)]


def _row(records: list[SceneRecord]) -> dict[str, Any]:
    solved = [record for record in records if record.success]
    first = records[0]
    random = generator(0, "bootstrap", *map(str, first.group))
    errors = [error for record in records for error in record.target_errors]
    mid_errors = [error for record in records for error in record.mid_errors]
    return {
        "scenario": first.scenario,
        "controller": first.controller,
        "tolerance": first.tolerance,
        "scenes": len(records),
        "successes": len(solved),
        "rate": _interval(wilson_interval(len(solved), len(records))),
        "pushes": _interval(bootstrap_mean(np.array([float(r.pushes) for r in solved]), random)),
        "final_distance": _mean([record.final_distance for record in records]),
        "planning_seconds": _mean([record.planning_seconds for record in records]),
        "target_error": _mean(errors),
        "mid_error": _mean(mid_errors),
        "refusals": sum(record.refusals for record in records),
        "fallbacks": sum(record.fallbacks for record in records),
    }


def _interval(interval: Interval) -> dict[str, float | None]:
    """Return an interval with None for NaN, which JSON does not have."""
    return {name: None if isnan(v) else v for name, v in dataclasses.asdict(interval).items()}


def _mean(values: list[float]) -> float | None:
    return float(np.mean(values)) if values else None


def results_table(summary: Sequence[dict[str, Any]]) -> str:
    """Return the summary as a markdown table, a line for each row of `summarise`."""
    return markdown_table(HEADER, map(table_cells, summary))


def table_cells(row: dict[str, Any]) -> list[str]:
    """Return the cells of one row of the summary, as `HEADER` names them."""
    rate, pushes = row["rate"], row["pushes"]["estimate"]
    return [
        row["scenario"],
        row["controller"],
        f"{100 * row['tolerance']:g} cm",
        f"{row['successes']}/{row['scenes']}",
        f"{100 * rate['low']:.0f}-{100 * rate['high']:.0f} %",
        "-" if pushes is None else f"{pushes:.1f}",
        _scaled(row["target_error"], 1e3, "mm"),
        _scaled(row["planning_seconds"], 1e3, "ms", digits=0),
    ]


def _scaled(value: float | None, factor: float, unit: str, digits: int = 1) -> str:
    if value is None or value == 0.0:
        return "-"
    return f"{factor * value:.{digits}f} {unit}"


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
