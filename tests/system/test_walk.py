"""The walk of docs/tutorials/walk.md, small: a recording becomes a model that closes the loop."""

import json
import os
import subprocess

import domain_coordinator
import numpy as np
import pytest

from sain_bags.reading.reader import Bag
from sain_model.data.dataset import load_dataset
from sain_model.dynamics.load import shipped_checkpoint
from tests.paths import ROOT
from tests.sain_model.conftest import read_card

pytestmark = pytest.mark.system

SCRIPT = ROOT / "examples" / "05_from_bag_to_model.sh"
EPISODES, EPOCHS = 3, 2


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    """The folder of a walk, and what was printed."""
    folder = tmp_path_factory.mktemp("walk") / "out"
    with domain_coordinator.domain_id() as domain:
        done = subprocess.run(
            [SCRIPT, folder, str(EPISODES), str(EPOCHS)],
            env={**os.environ, "ROS_DOMAIN_ID": str(domain), "PYTHONUTF8": "1", "COLUMNS": "200"},
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder, done.stdout


def test_the_recording_became_rows_and_the_rows_a_model(walked):
    folder, _ = walked
    data = load_dataset(folder / "data")
    assert len(np.unique(data.alike.episode)) == EPISODES
    card = read_card(folder / "model" / "sain.safetensors")
    assert card.data["sha256"] == data.sha256
    assert card.training["epochs_done"] == EPOCHS
    ancestors = [ancestor.weights_sha256 for ancestor in card.lineage()]
    assert ancestors[1:] == [read_card(shipped_checkpoint()).weights_sha256]


def test_the_graph_ran_with_that_model(walked):
    folder, _ = walked
    bag = Bag(folder / "after" / "bag")
    assert bag.custom_data["model"] == str(folder / "model" / "sain.safetensors")
    summary = json.loads((folder / "after" / "summary.json").read_text())
    (episode,) = summary["episodes"]
    assert episode["seed"] == 1000 and episode["pushes"] >= 1
    assert episode["fallbacks"] == 0  # every push was planned with it
    assert 0.0 < episode["model_error"] < 0.05


def test_what_it_says_is_what_was_measured(walked):
    folder, told = walked
    for report in ("shipped", "tuned"):
        errors = json.loads((folder / f"{report}.json").read_text())
        moved = errors["after"]["1"]["errors"]["all that moved"]["SAIN, history"]
        assert f"{moved['mm'][0]:6.2f} mm mean error" in told
        rows = load_dataset(folder / "unseen")
        assert errors["transitions"] == len(rows)
    lines = [line for line in told.splitlines() if line.startswith("--- ")]
    assert [line[4] for line in lines] == list("1234567")
    assert f"of {EPISODES} reached the goal" in told
