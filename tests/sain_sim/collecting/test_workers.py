import os
import signal
from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path

import pytest

from sain_core.errors import SainError
from sain_sim.collecting.collect import CollectConfig, collect
from sain_sim.collecting.episode import EpisodeConfig

SHORT = EpisodeConfig(pushes=3)


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> tuple[CollectConfig, dict[str, bytes]]:
    """What one process collects undisturbed: enough to be under way when a worker is killed."""
    config = CollectConfig(tmp_path_factory.mktemp("whole"), episodes=16, seed=4, episode=SHORT)
    collect(config)
    return config, content(config.out)


def test_after_a_killed_worker_the_same_command_continues(whole, tmp_path) -> None:
    config, expected = whole

    def kill(episodes: int, transitions: int) -> None:
        if episodes == 1:
            os.kill(active_children()[0].pid, signal.SIGKILL)

    two = replace(config, out=tmp_path, workers=2)
    with pytest.raises(SainError, match="a worker process died with exit code SIGKILL"):
        collect(two, kill)
    assert active_children() == []
    collect(two)
    assert content(tmp_path) == expected
