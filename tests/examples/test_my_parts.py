"""The package of `examples/my_parts`: its shape, cost, planner and scenario, installed and run."""

import json
import sys

import pytest

from sain_bringup.graph import executable
from tests.examples.installing import install, outcomes, refusals, run

BROKEN = {
    "sain.planners": ("bad_planner", "def bad_planner(search, start, generator): 1 / 0"),
    "sain.costs": ("bad_cost", "def bad_cost(rollout, objective): return rollout.pushes"),
    "sain.scenarios": ("bad_scenario", "bad_scenario = 3"),
}


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """The variables of processes for which the packages are installed, and for no others."""
    folder = tmp_path_factory.mktemp("parts")
    variables = install("my_parts", folder)
    package = folder / "site" / "broken_parts-0.3.dist-info"
    package.mkdir()
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: broken-parts\nVersion: 0.3\n")
    offers = [(group, name) for group, (name, _) in BROKEN.items()]
    points = "".join(f"[{group}]\n{name} = broken_parts:{name}\n" for group, name in offers)
    (package / "entry_points.txt").write_text(points)
    code = "\n".join(code for _, code in BROKEN.values())
    (folder / "site" / "broken_parts.py").write_text(code + "\n")
    return variables


SMALL = ["--scenes", "1", "--controllers", "planar", "--planner.samples", "64"]


def test_all_play_together(environment, tmp_path):
    given = ["--scenario", "my_scenario", "--planner.weights.more", "my_centre:0.5", "--out"]
    commands = {
        name: ["evaluate", *SMALL, *given, str(tmp_path / name), "--planner.algorithm", name]
        for name in ("my_planner", "my_icem")
    }
    assert {code for code, _ in outcomes(environment, commands).values()} == {0}
    for name in commands:
        summary = json.loads((tmp_path / name / "results.json").read_text())["summary"]
        assert {row["scenario"] for row in summary} == {"my_scenario"}
        assert [row["successes"] for row in summary] == [1, 1]


def test_a_shape_is_pushed(environment, tmp_path):
    collect = [str(executable("sain_sim", "collect")), "--episodes", "1", "--target", "my_arrow"]
    run(environment, collect, "--seed", 1, "--out", tmp_path / "data")


def test_the_new_terms_count_where_nothing_is_done(environment):
    lines = (
        "import numpy as np; from sain_core.scene import make_scene;"
        " from sain_mppi.objective.problem import Problem;"
        " from sain_mppi.config import CostWeights;"
        " from sain_mppi.objective.cost import Objective;"
        " scene = make_scene(np.array([[0.4, 0.0], [0.6, 0.3]]), np.ones(2), np.full(2, 0.05));"
        " from sain_core.goal import Goal; problem = Problem.of(scene, Goal.place(0.6, 0.3));"
        " costs = [Objective(problem, CostWeights(more=m))"
        ".rest_cost() for m in ('', 'my_centre:2.0')];"
        " print(round(costs[1] - costs[0], 6))"
    )
    assert run(environment, [sys.executable, "-c", lines]).strip() == str(
        round(2.0 * (0.1**2 + 0.3**2) ** 0.5, 6)
    )


WRONG = {
    "--planner.algorithm my_planer": (
        "planner 'my_planer' is unknown (did you mean 'my_planner'?); known: bad_planner, "
    ),
    "--planner.weights.more my_center:1": (
        "cost 'my_center' is unknown (did you mean 'my_centre'?); known: bad_cost, my_centre"
    ),
    "--planner.weights.more my_centre": "more is 'my_centre'; allowed: NAME:WEIGHT with commas",
    "--scenario my_senario": (
        "scenario 'my_senario' is unknown (did you mean 'my_scenario'?); known: anywhere"
    ),
    "--scenario bad_scenario": (
        "scenario 'bad_scenario' of package broken-parts 0.3: broken_parts:bad_scenario is a"
    ),
    "--scenario paper --planner.algorithm bad_planner": (
        "planner 'bad_planner' of package broken-parts 0.3 failed: ZeroDivisionError:"
    ),
    "--scenario paper --planner.weights.more bad_cost:1": (
        "cost 'bad_cost' of package broken-parts 0.3: it returned the shape ("
    ),
}


def test_what_is_wrong_is_named(environment, tmp_path):
    out = str(tmp_path / "results")
    commands = {wrong: ["evaluate", *SMALL, *wrong.split(), "--out", out] for wrong in WRONG}
    said = refusals(environment, commands)
    for wrong, message in WRONG.items():
        assert message in said[wrong]
