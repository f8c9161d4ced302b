"""The package of `examples/my_world`: its physics, installed and played in; and broken worlds."""

import json

import pytest

from sain_bringup.graph import executable
from tests.examples.installing import install, refusals, run

BROKEN = {
    "raising": "def push(self, push, *, seen=None): raise ZeroDivisionError('a bug')",
    "not_a_number": "def push(self, push, *, seen=None): return Outcome(self.at, self.at * np.nan)",
    "restless": "def push(self, push, *, seen=None): return Outcome(self.at, self.at + MOVING)",
    "shapeless": "def push(self, push, *, seen=None): return Outcome(self.at, self.at[:1])",
    "timeless": "def push(self, push, *, seen=None): return Outcome(self.at, self.at, -1.0)",
    "pushless": "",
}
CODE = """
import numpy as np
from sain_core.world import Outcome

MOVING = np.array([0, 0, 0, 0.3, 0, 0, 0, 0])


class World:
    def reset(self, start):
        self.at = start.scene
        return self.at

    def observe(self):
        return self.at

"""
PACKAGE = "of package broken-worlds 0.3"


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """The variables of processes for which the packages are installed, and for no others."""
    folder = tmp_path_factory.mktemp("worlds")
    variables = install("my_world", folder)
    package = folder / "site" / "broken_worlds-0.3.dist-info"
    package.mkdir()
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: broken-worlds\nVersion: 0.3\n")
    points = "".join(f"{name} = {name}:load\n" for name in BROKEN)
    (package / "entry_points.txt").write_text(f"[sain.worlds]\n{points}")
    for name, method in BROKEN.items():
        code = f"{CODE}    {method}\n\n\ndef load(name):\n    return World()\n"
        (folder / "site" / f"{name}.py").write_text(code)
    return variables


SMALL = ["--scenes", "1", "--controllers", "planar", "--workers", "1"]


def evaluate(*arguments: object) -> list[str]:
    return [str(executable("sain_eval", "evaluate")), *SMALL, *map(str, arguments)]


def test_an_agent_reaches_its_goals_in_it(environment, tmp_path):
    out = tmp_path / "results"
    run(environment, evaluate("--engine", "my_world", "--scenario", "anywhere", "--out", out))
    results = json.loads((out / "results.json").read_text())
    assert [row["successes"] for row in results["summary"]] == [1] * len(results["summary"])
    assert results["config"]["truth"]["engine"] == "my_world"


def test_the_graph_plays_in_it(environment, tmp_path):
    command = [str(executable("sain_bringup", "closed_loop")), "--engine", "my_world"]
    options = ["--scenario", "anywhere", "--model", "planar", "--no-video"]
    said = run(environment, command, *options, "--out", tmp_path / "results")
    assert "reached" in said


WRONG = {
    "raising": f"{PACKAGE}: push raised ZeroDivisionError: a bug; repair or uninstall",
    "not_a_number": f"{PACKAGE}: push: body 0 has NaN or Inf; allowed: finite numbers",
    "restless": f"{PACKAGE}: push: the scene did not settle; allowed: every body slower",
    "shapeless": f"{PACKAGE}: push: the scene is (1, 8); allowed: an array (2, 8)",
    "timeless": f"{PACKAGE}: push: the duration is -1.0; allowed: 0 to 3600 s",
    "pushless": "it must return a world, with the methods reset, observe and push",
    "my_wolrd": "engine 'my_wolrd' is unknown (did you mean 'my_world'?); known: bullet,",
    "my_world": "my_world has disks that move, and nothing else",
}


def test_a_broken_world_is_one_line(environment, tmp_path):
    commands = {}
    for name in WRONG:
        scenario = "push_t" if name == "my_world" else "anywhere"
        options = ["--engine", name, "--scenario", scenario, "--out", str(tmp_path / name)]
        commands[name] = ["evaluate", *SMALL, *options]
    said = refusals(environment, commands)
    for name, text in WRONG.items():
        assert text in said[name]
        assert name in said[name]
