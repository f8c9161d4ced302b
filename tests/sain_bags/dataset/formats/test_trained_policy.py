"""LeRobot trains a policy on a data set of ours, and the saved policy pushes as it is."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

os.environ["HF_HUB_OFFLINE"] = "1"

from sain_core.errors import ConfigError
from sain_core.goal import Goal
from sain_core.policy import ACTION, GOAL, STATE, load_policy, observe
from sain_core.shapes.bodies import PAPER_DISKS
from tests.sain_bags.dataset.formats.exported import to
from tests.sain_mppi.ros.straw import START


@pytest.fixture
def trained(bag: Path, tmp_path: Path) -> Path:
    """The folder of a policy after two steps of LeRobot's own training."""
    from sain_core.pretrained import LeRobotDataset  # noqa: F401 - before lerobot

    from lerobot.configs.default import DatasetConfig  # isort: skip
    from lerobot.configs.train import TrainPipelineConfig  # isort: skip
    from lerobot.policies.act.configuration_act import ACTConfig  # isort: skip
    from lerobot.scripts.lerobot_train import train  # isort: skip

    folder = tmp_path / "trained"
    data = to("lerobot", bag, folder / "data")
    size = {"dim_model": 16, "n_heads": 2, "dim_feedforward": 16, "chunk_size": 2}
    policy = ACTConfig(device="cpu", push_to_hub=False, n_action_steps=1, **size)
    dataset = DatasetConfig("pushes", root=str(data), video_backend="pyav")
    about = {"batch_size": 2, "steps": 2, "num_workers": 0, "eval_freq": 0}
    train(TrainPipelineConfig(dataset, policy=policy, output_dir=folder / "out", **about))
    return folder / "out/checkpoints/last/pretrained_model"


def test_it_takes_our_observations_and_gives_pushes(trained: Path, tmp_path: Path) -> None:
    policy = load_policy(str(trained))
    assert policy.features == {STATE: (16,), GOAL: (10,)}
    seen, actions = observe(START, Goal.place(0.7, 0.05), PAPER_DISKS), []
    for _ in range(2):
        policy.reset(1)
        actions.append(policy.select_action(seen))
    np.testing.assert_array_equal(*actions)
    assert actions[0].shape == (5,)
    assert abs(actions[0][1:] - [0.0, 0.0, 0.1, 0.2]).max() < 4.0  # as in the data set, not scaled
    about = Path(json.loads((trained / "train_config.json").read_text())["dataset"]["root"])
    stated = json.loads((about / "meta/info.json").read_text())
    stated["features"][ACTION]["names"] = ["x", "y", "heading", "length", "speed"]
    (about / "meta/info.json").write_text(json.dumps(stated))
    with pytest.raises(ConfigError, match=r"info.json: action has x, y, .* not body, location"):
        load_policy(str(trained))
