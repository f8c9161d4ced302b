"""``make anything`` as a person starts it, with a body of his own."""

import json
import subprocess
import sys

import pytest
from PIL import Image

from benchmarks.anything.__main__ import RESULTS
from sain_bags.reading.reader import Bag
from sain_core.output import write_json
from tests.paths import ROOT

BLOCK = [[-0.06, -0.04], [0.06, -0.04], [0.06, 0.04], [-0.06, 0.04]]


@pytest.mark.system
def test_a_body_comes_to_a_goal_by_its_tags_alone_and_a_film_shows_it(tmp_path):
    rows = [{"name": "Block", "outline_m": BLOCK, "height_m": 0.05}]
    data, out = write_json(tmp_path / "objects.json", {"objects": rows}), tmp_path / "out"
    command = [sys.executable, "-m", "benchmarks.anything", "--data", data, "--robots", "ur5"]
    given = [*command, "--goals", "1", "--film", "block", "--out", out]
    done = subprocess.run(given, cwd=ROOT, capture_output=True, text=True, timeout=400)
    assert done.returncode == 0, done.stderr
    (goal,) = json.loads((out / RESULTS).read_text())["trials"]["ur5 tags block"]["goals"]
    assert goal["failure"] == "" and goal["seconds"] > 0.0 and goal["at_rest"] <= 1.0
    assert goal["commit"] in (out / "anything.md").read_text()
    stamps = {"/sain/scene": set(), "/sain/truth": set(), "/sain/poses": set()}
    for received in Bag(next((out / "logs" / "ur5-tags-block").glob("bag-*"))).messages(stamps):
        stamp = received.message.header.stamp
        stamps[received.topic].add((stamp.sec, stamp.nanosec))
    assert stamps["/sain/scene"] and stamps["/sain/truth"] and not stamps["/sain/poses"]
    assert not stamps["/sain/scene"] & stamps["/sain/truth"], "a scene is of an image"
    with Image.open(out / "anything.gif") as film:
        assert film.n_frames > 3
