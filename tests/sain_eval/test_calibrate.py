import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sain_core.errors import DatasetError
from sain_core.push import LOCATION, PushLimits
from sain_core.scene import make_scene, unit
from sain_eval import commands
from sain_eval.calibrate import FREE, START, calibrate
from sain_model.data.dataset import load_dataset
from sain_model.physics.planar import PlanarPrior

TRUTH = replace(START, tool_friction=0.25, foot_radius=0.55)
PUSHES, EPISODES = 240, 40


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pushes of a world that is the planar prior with other parameters."""
    random = np.random.default_rng(0)
    scenes = np.stack(
        [
            make_scene(
                np.array([0.5, 0.0]) + np.stack([np.zeros(2), 0.141 * unit(np.array(bearing))]),
                random.uniform(7.0, 9.0, 2),
                np.array([0.08, 0.06]),
            )
            for bearing in random.uniform(-0.5, 0.5, PUSHES)
        ]
    )
    pushes = PushLimits().sample(random, PUSHES)
    pushes[:, LOCATION] *= 0.2
    friction = random.uniform(0.08, 0.2, PUSHES)
    after = PlanarPrior(TRUTH).step(scenes, pushes, {"friction": friction})
    folder = tmp_path_factory.mktemp("calibration")
    np.savez(
        folder / "shard.npz",
        state=scenes,
        action=pushes,
        physics_next=after,
        next_state=after,
        floor_next=after + 1e-5,
        episode=np.repeat(np.arange(EPISODES), PUSHES // EPISODES),
        friction=friction,
    )
    return folder


def test_parameters_are_fitted_and_judged_on_other_episodes(dataset: Path, tmp_path: Path) -> None:
    out = tmp_path / "report"
    options = ["--steps", "20", "--fit-share", "0.5"]
    assert commands.calibrate([str(dataset), "--out", str(out), *options]) == 0
    report = json.loads((out / "calibration.json").read_text())
    assert set(report["fitted"]) == set(FREE)
    judged = report["accuracy"]["target_moved"]
    assert judged["fitted"]["target_mean"] < 0.5 * judged["before"]["target_mean"]
    assert judged["fitted"]["pushes"] + report["fit_pushes"] <= PUSHES
    assert judged["floor"]["target_mean"] == pytest.approx(0.01 * 2**0.5)
    text = (out / "calibration.md").read_text()
    assert "| fitted |" in text
    assert "| tool_friction |" in text


def test_without_the_true_friction_nothing_can_be_fitted(dataset: Path) -> None:
    data = load_dataset(dataset).alike
    data.friction[0] = np.nan
    with pytest.raises(DatasetError, match="no true friction"):
        calibrate(data, 0.25, 30)


def test_a_missing_data_set_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = tmp_path / "none.npz"
    assert commands.calibrate([str(missing), "--out", str(tmp_path)]) == 1
    assert "does not exist" in " ".join(capsys.readouterr().err.split())
