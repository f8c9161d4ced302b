"""What the examples for Gymnasium print and write is true."""

import io
import json
import re
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pyarrow.parquet as pq
from PIL import Image

import sain_gym  # noqa: F401  (registers the environment)
from tests.paths import ROOT


def run(name: str, *arguments: str, folder: Path) -> str:
    """Run an example; return what it printed."""
    command = [sys.executable, str(ROOT / "examples" / name), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


def test_a_policy_learns(tmp_path):
    rounds = 3
    printed = run("06_train_in_gymnasium.py", str(rounds), folder=tmp_path)
    means = [float(value) for value in re.findall(r"mean return +(-[\d.]+)", printed)]
    assert len(means) == rounds
    assert means[-1] > 0.6 * means[0]
    before, after = map(int, re.findall(r"(\d+) of 20 test scenes solved", printed))
    assert before <= after


def test_demonstrations_are_what_the_agent_saw_and_did(tmp_path):
    printed = run("07_demonstrations_for_lerobot.py", "demos", "1", folder=tmp_path)
    assert printed.count("reached") == 1
    (path,) = (tmp_path / "demos" / "data").rglob("*.parquet")
    frames = pq.read_table(path).to_pylist()
    assert f"demos: 1 episodes, {len(frames)} frames" in printed
    assert sum(frame["next.done"] for frame in frames) == 1
    env = gymnasium.make("sain/Push-v0", observation="image")
    image, info = env.reset(seed=1_000_000)
    for frame in frames[: 1 + [frame["next.done"] for frame in frames].index(True)]:
        stored = Image.open(io.BytesIO(frame["observation.image"]["bytes"]))
        assert np.abs(np.asarray(stored, dtype=int) - image).mean() < 0.1
        assert np.allclose(frame["observation.state"], env.unwrapped.scene.ravel(), atol=1e-3)
        action = np.array(frame["action"], dtype=np.float32)
        image, reward, _, _, info = env.step(action)
        assert abs(reward - frame["next.reward"]) < 1e-3
    assert info["is_success"]
    env.close()


def test_lerobots_own_evaluation_runs_our_agent_in_our_environment(tmp_path):
    arguments = "--policy.type=sain --env.type=sain --env.scenario=paper --policy.controller=planar"
    arguments += " --eval.n_episodes=2 --eval.batch_size=2 --seed=0 --output_dir=out"
    command = [sys.executable, str(ROOT / "examples/09_lerobot_eval.py"), *arguments.split()]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    overall = json.loads((tmp_path / "out/eval_info.json").read_text())["overall"]
    assert (overall["n_episodes"], overall["pc_success"]) == (2, 100.0)
