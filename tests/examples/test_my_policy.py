"""`examples/my_policy` trains on our agent's episodes, and evaluate asks it for pushes by name."""

import os
import subprocess
import sys

from sain_bringup.graph import executable
from tests.paths import ROOT

FOLDER = ROOT / "examples/my_policy"


def run(folder, *command):
    variables = {**os.environ, "PYTHONPATH": f"{FOLDER}:{os.environ.get('PYTHONPATH', '')}"}
    done = subprocess.run(
        command, cwd=folder, env=variables, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_it_is_trained_and_evaluated(tmp_path):
    printed = run(tmp_path, sys.executable, str(FOLDER / "my_policy.py"), "2", "20")
    assert "pushes of 2 episodes" in printed and "wrote runs/my_policy.pt" in printed
    evaluate = str(executable("sain_eval", "evaluate"))
    name = "policy:my_policy:load"
    arguments = ["--controllers", name, "--scenes", "1", "--out", "results"]
    assert "my_policy" in run(tmp_path, evaluate, *arguments)
    assert f'"{name}"' in (tmp_path / "results/results.json").read_text()
