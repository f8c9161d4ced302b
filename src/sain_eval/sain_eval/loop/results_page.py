"""A page of results: scenarios in rows, realities in columns, the paper's numbers beside them.

A reality is a world that executes pushes: an engine with its physics, or a package's world.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

from sain_core.cli.terminal import markdown_table
from sain_core.errors import DatasetError
from sain_core.guarding.documents import read_json
from sain_core.shapes.shape import FEET
from sain_core.world import ObservationConfig, changed_settings, observation_settings
from sain_eval.loop.closed_loop import ORACLE
from sain_eval.loop.results import RESULTS_FILE, SCHEMA, record_of, summarise
from sain_eval.loop.tables import solved_text, within_text
from sain_eval.scenes.scenarios import SCENARIOS
from sain_sim.world.engines import ENGINES

REALITY_NAMES: Final = {
    ("bullet", "randomised"): "Bullet",
    ("bullet", "rough"): "Bullet, rough",
    ("mujoco", "randomised"): "MuJoCo",
    ("mujoco", "measured"): "MuJoCo, measured",
}
SHIPPED: Final = "SAIN as shipped"
CONTROLLER_NAMES: Final = {
    "null": "no push",
    "random": "random pushes",
    "straight": "straight pushes",
    "planar": "planar prior, history",
    "planar_axes": "planar prior with Bullet's axes, history",
    "learned only": "learned only",
    "sain": SHIPPED,
}
"""What people read, in the order of the page. The oracle, and others by their names, follow."""

PAPER: Final = {
    "paper": "40/40 (91-100 %)",
    "paper_shift": "succeeds, n not given",
    "paper_cube": "succeeds, n not given",
}
"""The paper's Table I and section III-D: SAIN and MPPI in Bullet, to `PAPER_TOLERANCE`."""
PAPER_TOLERANCE: Final = 0.05  # [m]
PAPER_REALITY: Final = REALITY_NAMES["bullet", "randomised"]
PAPER_COLUMN: Final = "the paper, to 5 cm"
MARK: Final = "<!-- not tested: takes hours -->"  # of the commands; see tools/site/notes.py

INTRODUCTION: Final = """# Results

For users who compare models, planners and worlds. `make table` writes this page from the recorded
episodes. *Solved*: scenes solved, with their 95 % interval (Wilson). *Pushes*: mean of the solved
scenes. *mm*: mean prediction error of pushes that moved a body of the goal by 2 mm or more. *By
physics*: pushes that the prior planned, because the model did not answer. *Oracle*: the planner
with the true friction.
"""


OVERVIEW: Final = """## Overview

Scenes solved and pushes, at the smallest tolerance of each scenario.
"""


@dataclass(frozen=True)
class RunResults:
    """What one evaluation wrote."""

    reality: str  # where it was played, as people read it
    command: str  # that played it
    commit: str  # of the code
    summary: Sequence[dict[str, Any]]  # its rows; see `sain_eval.loop.results.summarise`


def read_results(folder: Path) -> RunResults:
    """Read the results of an evaluation from its folder.

    Raises `DatasetError`: there are none, or these are not results.
    """
    path = folder / RESULTS_FILE
    try:
        content = read_json(path)
        if content["schema"] != SCHEMA:
            raise DatasetError(f"{path} has the schema {content['schema']!r}; allowed: {SCHEMA!r}")
        summary = summarise([record_of(item) for item in content["scenes"]])
        commit = str(content["git_commit"] or "unknown")
        return RunResults(_reality(content["config"]), str(content["command"]), commit, summary)
    except OSError as error:
        raise DatasetError(f"{path} cannot be read ({error}); run an evaluation first") from error
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise DatasetError(f"{path} holds no results of an evaluation: {error!r}") from error


def _reality(config: Mapping[str, Any]) -> str:
    """Return the name of the world in which an evaluation was played, and how it was observed."""
    truth, camera = config["truth"], config.get("camera", {})
    key = (truth.get("engine", "bullet"), truth["world"])
    names = observation_settings(ObservationConfig())
    seen = ObservationConfig(**{name: camera[name] for name in names if name in camera})
    bottom = truth.get("bottom", FEET)
    words = [f"bottom {bottom}"] if bottom != FEET else []
    words += [f"{name} {value}" for name, value in changed_settings(seen).items()]
    other = ", ".join(key) if key[0] in ENGINES else key[0]
    return ", ".join([REALITY_NAMES.get(key, other), *words])


class Line(NamedTuple):
    """A row of a scenario's table."""

    scenario: str
    tolerance: float
    turn: float
    model: str  # as people read it
    within: str


Cells = dict[Line, dict[str, dict[str, Any]]]  # rows of summaries, by line and reality


def results_page(results: Sequence[RunResults], names: Mapping[str, str]) -> str:
    """Return the page of several evaluations; `names` has other names of controllers.

    Of two evaluations with the same row and reality, the later one counts.
    """
    shown = {**CONTROLLER_NAMES, **names}
    shown[ORACLE] = shown.pop(ORACLE, ORACLE)  # the last of those with a name
    order = list(dict.fromkeys(shown.values()))
    realities = list(dict.fromkeys(one.reality for one in results))
    cells: Cells = {}
    for one in results:
        for row in one.summary:
            cells.setdefault(_line(row, shown), {})[one.reality] = row
    parts = [INTRODUCTION, OVERVIEW]
    parts += [_overview(cells, reality, order) for reality in realities]
    parts += [_details(cells, name, realities, order) for name in _scenarios(cells)]
    shown_rows = {id(row) for line in cells.values() for row in line.values()}
    used = [one for one in results if any(id(row) in shown_rows for row in one.summary)]
    return "\n".join([*parts, _sources(used)])


def _line(row: dict[str, Any], shown: Mapping[str, str]) -> Line:
    model = shown.get(row["controller"], row["controller"])
    tolerance = row["tolerance"], row["heading_tolerance"]
    return Line(row["scenario"], *tolerance, model, within_text(row))


def _overview(cells: Cells, reality: str, order: Sequence[str]) -> str:
    """Return a table of one reality: scenarios in rows, models in columns."""
    here = [line for line in cells if reality in cells[line]]
    models = _in_order((line.model for line in here), order)
    with_paper = reality == PAPER_REALITY and any(line.scenario in PAPER for line in here)
    rows = []
    for scenario in _scenarios(here):
        smallest = min(line[1:3] for line in here if line.scenario == scenario)
        lines = [line for line in here if (line.scenario, *line[1:3]) == (scenario, *smallest)]
        found = {line.model: _short(cells[line][reality]) for line in lines}
        paper = [PAPER.get(scenario, "")] if with_paper else []
        scenes = [lines[0].within, *paper, *(found.get(model, "") for model in models)]
        unbroken = [cell.replace(" ", "\u00a0") for cell in scenes]  # on a narrow screen, too
        rows.append([f"`{scenario}`", *unbroken])
    header = ("scenario", "within", *([PAPER_COLUMN] if with_paper else []), *models)
    return f"### {reality}\n\n{markdown_table(header, rows)}"


def _details(cells: Cells, scenario: str, realities: Sequence[str], order: Sequence[str]) -> str:
    """Return a table of one scenario: tolerances and models in rows, realities in columns."""
    lines = sorted(
        (line for line in cells if line.scenario == scenario),
        key=lambda line: (-line.tolerance, -line.turn, _place(line.model, order), line.model),
    )
    played = [one for one in realities if any(one in cells[line] for line in lines)]
    paper = [PAPER_COLUMN] if scenario in PAPER else []
    rows = [
        [line.within, line.model]
        + [_papers(line) for _ in paper]
        + [_cell(cells[line][one]) if one in cells[line] else "" for one in played]
        for line in lines
    ]
    header = ("within", "model", *paper, *played)
    return f"## `{scenario}`\n\n{markdown_table(header, rows)}"


def _papers(line: Line) -> str:
    """Return the paper's number in a line, where it has one."""
    same = line.model == SHIPPED and line.tolerance == PAPER_TOLERANCE
    return PAPER[line.scenario] if same else ""


def _sources(results: Sequence[RunResults]) -> str:
    lines = [f"# {one.reality}, commit {one.commit[:12]}\n{one.command}\n" for one in results]
    return f"## Commands\n\n{MARK}\n```\n{''.join(lines)}```\n"


def _short(row: dict[str, Any]) -> str:
    pushes = row["pushes"]["estimate"]
    return f"{row['successes']}/{row['scenes']}" + ("" if pushes is None else f", {pushes:.1f}")


def _cell(row: dict[str, Any]) -> str:
    rate, pushes, error = row["rate"], row["pushes"]["estimate"], row["target_error"]
    low, high = (100 * rate[end] for end in ("low", "high"))
    parts = [f"**{solved_text(row)}** ({low:.0f}-{high:.0f} %)"]
    if pushes is not None:
        parts.append(f"{pushes:.1f} pushes")
    if row["seconds"]:
        parts.append(f"{row['seconds']:.1f} s")
    if error is not None:
        parts.append(f"{1e3 * error:.1f} mm")
    if row["fallbacks"]:
        parts.append(f"{row['fallbacks']} by physics")
    return ", ".join(parts)


def _scenarios(lines: Iterable[Line]) -> list[str]:
    return _in_order((line.scenario for line in lines), list(SCENARIOS))


def _in_order(found: Iterable[str], order: Sequence[str]) -> list[str]:
    return sorted(set(found), key=lambda name: (_place(name, order), name))


def _place(name: str, order: Sequence[str]) -> int:
    return order.index(name) if name in order else len(order)
