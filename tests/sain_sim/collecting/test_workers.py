import os
import signal
import time
from dataclasses import replace
from functools import partial
from multiprocessing import active_children
from pathlib import Path

import pytest

from sain_core.errors import SainError
from sain_core.workers import AHEAD, LIVES, FunctionRunner, Software, Work, run_on_processes
from sain_sim.collecting.collect import CollectConfig, collect
from sain_sim.collecting.episode import EpisodeConfig, EpisodeResult

SHORT = EpisodeConfig(pushes=3)
NO_SOFTWARE = Software((), ())


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> tuple[CollectConfig, dict[str, bytes]]:
    """What one process collects undisturbed."""
    config = CollectConfig(tmp_path_factory.mktemp("whole"), episodes=5, seed=4, episode=SHORT)
    collect(config)
    return config, content(config.out)


class Numbers:
    """Does nothing, and leaves a file for each job."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def run(self, job: int) -> int:
        (self.folder / str(job)).touch()
        return job

    def close(self) -> None:
        pass


def test_results_come_back_in_order_and_no_worker_runs_far_ahead(tmp_path) -> None:
    work = Work(partial(Numbers, tmp_path), NO_SOFTWARE, str)
    results = run_on_processes(work, range(100), 2, ordered=True)
    assert next(results) == 0
    time.sleep(0.5)
    assert len(list(tmp_path.iterdir())) <= 2 * AHEAD
    assert list(results) == list(range(1, 100))
    assert sorted(run_on_processes(work, range(9), 2, ordered=False)) == list(range(9))


def test_a_worker_killed_in_mid_episode_costs_nothing(whole, tmp_path, caplog) -> None:
    config, expected = whole

    def kill(episodes: int, transitions: int) -> None:
        if episodes == 1:
            os.kill(active_children()[0].pid, signal.SIGKILL)

    collect(replace(config, out=tmp_path, workers=2), kill)
    assert content(tmp_path) == expected
    assert "ended a worker with exit code SIGKILL(-9); its jobs are done again" in caplog.text
    assert active_children() == []


def kill_oneself(job: int) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_an_episode_that_ends_every_worker_is_named() -> None:
    work = Work(partial(FunctionRunner, kill_oneself), NO_SOFTWARE, lambda job: f"episode {job}")
    with pytest.raises(SainError, match=rf"{LIVES} workers died.* episode 7 ended .*-9.; w"):
        list(run_on_processes(work, [7], 1, ordered=True))
    assert active_children() == []


def test_an_episode_that_cannot_be_run_is_an_error_of_the_collection(tmp_path) -> None:
    crowded = replace(SHORT, disks=5)
    errors = []
    for workers in (1, 2):
        with pytest.MonkeyPatch.context() as patch, pytest.raises(SainError) as caught:
            patch.setattr("sain_core.workers._do", _refuse)
            patch.setattr("sain_sim.collecting.episode.EpisodeRunner.run", _no_room)
            collect(CollectConfig(tmp_path, episodes=3, workers=workers, episode=crowded))
        errors.append(str(caught.value))
    assert errors == ["no room"] * 2 and active_children() == []


def _no_room(*_: object) -> EpisodeResult:
    raise SainError("no room")


def _refuse(job: int) -> EpisodeResult:
    raise SainError("no room")
