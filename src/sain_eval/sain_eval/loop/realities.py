"""A page of results: scenarios in rows, realities in columns.

A reality is a world that executes pushes: an engine with its physics, or somebody else's benchmark.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sain_core.errors import DatasetError
from sain_core.observation import ObservationConfig, observation_settings, told_settings
from sain_eval.loop.controllers import ORACLE
from sain_eval.loop.results import RESULTS_FILE, SCHEMA
from sain_eval.loop.tables import solved_text, tolerance_text
from sain_eval.scenes.scenarios import SCENARIOS
from sain_model.evaluation.markdown import markdown_table

MOST_BYTES: Final = 500_000_000  # of a results file
REALITY_NAMES: Final = {
    ("bullet", "randomised"): "Bullet",
    ("bullet", "rough"): "Bullet, rough",
    ("mujoco", "randomised"): "MuJoCo",
}
CONTROLLER_NAMES: Final = {
    "null": "no push",
    "straight": "straight pushes",
    "random": "random pushes",
    "planar": "planar prior, history",
    "planar_axes": "planar prior with Bullet's axes, history",
    "sain": "SAIN as shipped",
    ORACLE: "oracle: prior with true friction",
}
"""What people read; the order is that of the page. Others come after, by their own names."""

INTRODUCTION: Final = """# Results

For users who compare models, planners and worlds. `make table` writes this page from the recorded
episodes. A cell has the solved scenes with their 95 % interval (Wilson), the mean pushes of the
solved scenes, and the mean prediction error of all pushes.
"""


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
        if path.stat().st_size > MOST_BYTES:
            raise DatasetError(f"{path} has more than {MOST_BYTES:,} bytes")
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["schema"] != SCHEMA:
            raise DatasetError(f"{path} has the schema {content['schema']!r}; allowed: {SCHEMA!r}")
        return Results(
            _reality(content["config"]),
            content["command"],
            str(content["git_commit"] or "unknown"),
            content["summary"],
        )
    except OSError as error:
        raise DatasetError(f"{path} cannot be read ({error}); run an evaluation first") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise DatasetError(f"{path} holds no results of an evaluation: {error!r}") from error


def _reality(config: Mapping[str, Any]) -> str:
    """Return the name of the world in which an evaluation was played."""
    if "reality" in config:
        return str(config["reality"])
    truth = config["truth"]
    key = (truth.get("engine", "bullet"), truth["world"])
    seen = told_settings(ObservationConfig(**_observed(config.get("camera", {}))))
    words = [f"{name} {value}" for name, value in seen.items()]
    return ", ".join([REALITY_NAMES.get(key, f"{key[0]}, {key[1]}"), *words])


def _observed(camera: Mapping[str, Any]) -> dict[str, Any]:
    """Return what was recorded of how bodies were observed; earlier results have nothing."""
    names = observation_settings(ObservationConfig())
    return {name: value for name, value in camera.items() if name in names}


def results_page(results: Sequence[Results], names: Mapping[str, str]) -> str:
    """Return the page of several evaluations; `names` has other names of controllers.

    Of two evaluations with the same row and reality, the later one counts.
    """
    shown = {**CONTROLLER_NAMES, **names}
    realities = list(dict.fromkeys(one.reality for one in results))
    cells: dict[tuple[Any, ...], dict[str, str]] = {}
    for one in results:
        for row in one.summary:
            cells.setdefault(_key(row), {})[one.reality] = _cell(row)
    order = list(shown)
    parts = [INTRODUCTION]
    for scenario in _in_order((key[0] for key in cells), list(SCENARIOS)):
        rows = [
            [tolerance_text(*key[1:3]), shown.get(key[3], key[3])]
            + [cells[key].get(reality, "") for reality in realities]
            for key in sorted(
                (key for key in cells if key[0] == scenario),
                key=lambda key: (-key[1], -key[2], _place(key[3], order), key[3]),
            )
        ]
        header = ("within", "controller", *realities)
        parts.append(f"## `{scenario}`\n\n{markdown_table(header, rows)}")
    parts.append(_sources(results))
    return "\n".join(parts)


def _sources(results: Sequence[Results]) -> str:
    lines = [f"* {one.reality}: `{one.command}`, commit {one.commit[:12]}\n" for one in results]
    return f"## Commands\n\n{''.join(lines)}"


def _key(row: dict[str, Any]) -> tuple[str, float, float, str]:
    return row["scenario"], row["tolerance"], row["heading_tolerance"], row["controller"]


def _cell(row: dict[str, Any]) -> str:
    rate, pushes, error = row["rate"], row["pushes"]["estimate"], row["target_error"]
    low, high = (100 * rate[end] for end in ("low", "high"))
    parts = [f"**{solved_text(row)}** ({low:.0f}-{high:.0f} %)"]
    if pushes is not None:
        parts.append(f"{pushes:.1f} pushes")
    if error is not None:
        parts.append(f"{1e3 * error:.1f} mm")
    return ", ".join(parts)


def _in_order(found: Any, order: Sequence[str]) -> list[str]:
    return sorted(set(found), key=lambda name: (_place(name, order), name))


def _place(name: str, order: Sequence[str]) -> int:
    return order.index(name) if name in order else len(order)
