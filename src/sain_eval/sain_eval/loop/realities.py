"""Results of an evaluation as they are read, with the reality that they are of.

A reality is a world that executes pushes: an engine with its physics, or somebody else's benchmark.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sain_core.errors import DatasetError
from sain_core.observation import ObservationConfig, observation_settings, told_settings
from sain_core.untrusted import read_json
from sain_eval.loop.results import RESULTS_FILE, SCHEMA

NEEDED: Final = (
    "scenario", "controller", "tolerance", "heading_tolerance", "scenes", "successes", "rate",
    "pushes", "target_error", "most_goals", "goals_in_a_row",
)  # fmt: skip
NUMBER: Final = (int, float)
KINDS: Final[dict[str, tuple[type, ...]]] = {
    "scenario": (str,), "controller": (str,), "within": (str, type(None)),
    "tolerance": NUMBER, "heading_tolerance": (*NUMBER, type(None)),
    "scenes": (int,), "successes": (int,), "most_goals": (int,), "goals_in_a_row": (list,),
    "target_error": (*NUMBER, type(None)), "steps": (*NUMBER, type(None)),
    "fallbacks": (*NUMBER, type(None)),
}  # fmt: skip
INTERVALS: Final[dict[str, tuple[type, ...]]] = {"rate": NUMBER, "pushes": (*NUMBER, type(None))}
REALITY_NAMES: Final = {
    ("bullet", "randomised"): "Bullet",
    ("bullet", "rough"): "Bullet, rough",
    ("mujoco", "randomised"): "MuJoCo",
}


@dataclass(frozen=True)
class Results:
    """What one evaluation wrote.

    Attributes:
        reality: where it was played, as people read it.
        command: that played it.
        commit: of the code.
        summary: its rows; see `sain_eval.loop.results.summarise`.
    """

    reality: str
    command: str
    commit: str
    summary: Sequence[dict[str, Any]]


def read_results(folder: Path) -> Results:
    """Read the results of an evaluation from its folder.

    Raises:
        DatasetError: there are none, or these are not results.
    """
    path = folder / RESULTS_FILE
    try:
        content = read_json(path)
        if content["schema"] != SCHEMA:
            raise DatasetError(f"{path} has the schema {content['schema']!r}; allowed: {SCHEMA!r}")
        lacking = {name for row in content["summary"] for name in NEEDED if name not in row}
        if lacking:
            raise DatasetError(
                f"{path} is of an earlier version, without {', '.join(sorted(lacking))}; run the"
                " evaluation again"
            )
        for row in content["summary"]:
            _check_row(row)
        return Results(
            str(content.get("reality") or _reality(content["config"])),
            str(content["command"]),
            str(content["git_commit"] or "unknown"),
            content["summary"],
        )
    except OSError as error:
        raise DatasetError(f"{path} cannot be read ({error}); run an evaluation first") from error
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise DatasetError(f"{path} holds no results of an evaluation: {error!r}") from error


def _check_row(row: Mapping[str, Any]) -> None:
    values = [(name, row[name], kinds) for name, kinds in KINDS.items() if name in row]
    values += [
        (f"{name}.{part}", row[name][part], kinds)
        for name, kinds in INTERVALS.items()
        for part in ("estimate", "low", "high")
    ]
    for name, value, kinds in values:
        if not isinstance(value, kinds):
            raise ValueError(f"{name} is {str(value)[:40]!r}")


def _reality(config: Mapping[str, Any]) -> str:
    """Return the name of the world in which an evaluation was played."""
    truth = config["truth"]
    key = (truth.get("engine", "bullet"), truth["world"])
    seen = told_settings(ObservationConfig(**_observed(config.get("camera", {}))))
    words = [f"{name} {value}" for name, value in seen.items()]
    return ", ".join([REALITY_NAMES.get(key, f"{key[0]}, {key[1]}"), *words])


def _observed(camera: Mapping[str, Any]) -> dict[str, Any]:
    """Return what was recorded of how bodies were observed; earlier results have nothing."""
    names = observation_settings(ObservationConfig())
    return {name: value for name, value in camera.items() if name in names}
