from dataclasses import replace
from pathlib import Path

import pytest

from sain_core.errors import CheckpointError
from sain_model.data.dataset import Split, load_dataset, split_by_episode
from sain_model.network.settings import NetworkConfig
from sain_model.training.learning_curve import learning_curve
from sain_model.training.settings import TrainingConfig

SIZES = (20, 60)
STEPS = 8
SMALL = TrainingConfig(batch=16, network=NetworkConfig(hidden=8, message=4, layers=1))


@pytest.fixture
def split(dataset: Path) -> Split:
    return split_by_episode(load_dataset(dataset), 0, 0.2, 0.2)


def test_every_size_is_learned_from_with_physics_and_without(split: Split, tmp_path: Path) -> None:
    begun: list[tuple[str, int]] = []
    first = learning_curve(split, SMALL, SIZES[:1], STEPS, tmp_path)
    kept = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("training.pt")}
    points = learning_curve(
        split, SMALL, SIZES, STEPS, tmp_path, lambda prior, size: begun.append((prior, size))
    )
    assert begun == [(prior, size) for size in SIZES for prior in ("identity", "planar")]
    assert kept == {path: path.stat().st_mtime_ns for path in kept}, "done is not done again"
    assert set(first) < set(points)
    with pytest.raises(CheckpointError, match="belongs to other settings or data"):
        learning_curve(split, replace(SMALL, seed=1), SIZES[:1], STEPS, tmp_path)
    measured = {(point.name, point.transitions) for point in points}
    networks = {"learned only", "SAIN", "SAIN, history"}
    assert {(name, size) for name in networks for size in SIZES} < measured
    physics = {name for name, size in measured if not size}
    assert {"bullet, nominal", "planar, measured", "floor"} < physics
    for point in points:
        assert 0.0 <= point.low <= point.mean <= point.high, point
    # the fixture's truth is the planar prior but for a few millimetres
    errors = {(point.name, point.transitions): point.mean for point in points}
    assert all(errors["SAIN", size] < errors["learned only", size] for size in SIZES)
