"""A bag of two episodes for all that is shown on a page."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.sain_bags.shown import Show


@pytest.fixture
def bag(record: Callable[..., object], tmp_path: Path) -> Path:
    """Two episodes, of two and three disks; the second with a push that was refused."""
    recording = record(custom_data={"episodes": "anywhere:4 clutter:5", "seed": "7"})
    show = Show(recording)
    show.episode(1, 2, [0.05, 0.03])
    show.episode(2, 3, [0.02, 0.04], refused=1)
    recording.writer.close()
    return tmp_path / "bag"
