import os
import signal
import subprocess
import time
from dataclasses import replace
from functools import partial
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest

from sain_bringup.graph import executable
from sain_core.errors import SainError
from sain_core.workers.pool import (
    AHEAD,
    LIVES,
    FunctionRunner,
    ProcessPool,
    Software,
    Work,
    WorkerPool,
    in_order,
)
from sain_sim.collecting.collect import CollectConfig, collect
from sain_sim.collecting.episode import EpisodeConfig, EpisodeResult, EpisodeRunner
from sain_sim.collecting.shards import JOURNAL_FILE, PushCounts
from sain_sim.commands import collect as main

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


class ShuffledPool(WorkerPool[int, EpisodeResult]):
    """Ends episodes in any order."""

    def __init__(self, size: int) -> None:
        super().__init__(size, Work(lambda: FunctionRunner(_no_room), NO_SOFTWARE, str))
        self.begun: list[int] = []
        self._running: list[int] = []
        self._random = np.random.default_rng(0)

    @property
    def free(self) -> int:
        return self.size - len(self._running)

    def begin(self, number: int, job: int) -> None:
        assert self.free and number == job
        self.begun.append(job)
        self._running.append(job)

    def finished(self) -> list[tuple[int, EpisodeResult]]:
        late = [episode for episode in self._running if episode]  # the first one ends last
        episode = self._random.choice(late) if late and len(self.begun) < 30 else self._running[0]
        self._running.remove(episode)
        return [(int(episode), EpisodeResult([], PushCounts(moved=int(episode))))]

    def close(self) -> None:
        self._running.clear()


def test_episodes_come_back_in_order_and_no_worker_runs_far_ahead() -> None:
    pool = ShuffledPool(4)
    results = in_order(pool, range(100))
    assert next(results).counts.moved == 0
    assert max(pool.begun) < AHEAD * pool.size
    assert [result.counts.moved for result in results] == list(range(1, 100))
    assert pool.begun == list(range(100))


def test_a_worker_killed_in_mid_episode_costs_nothing(whole, tmp_path, caplog, monkeypatch) -> None:
    config, expected = whole
    begin, begun = ProcessPool.begin, []

    def begin_and_kill(pool, number, job) -> None:
        begin(pool, number, job)
        begun.append(number)
        if begun.count(2) == 1 and number == 2:
            ((worker, _, _),) = (one for one in pool._busy.values() if one[1] == number)
            os.kill(worker.process.pid, signal.SIGKILL)

    monkeypatch.setattr(ProcessPool, "begin", begin_and_kill)
    collect(replace(config, out=tmp_path, workers=2))
    assert content(tmp_path) == expected
    assert "a worker died (exit code -9); episode" in caplog.text
    assert sorted(begun) == [0, 1, 2, 2, 3, 4]
    assert active_children() == []


def test_an_episode_that_ends_every_worker_is_named() -> None:
    class Doomed(ProcessPool):
        def _start(self):
            worker = super()._start()
            worker.process.kill()
            return worker

    work = Work(partial(EpisodeRunner, 0, SHORT), NO_SOFTWARE, lambda job: f"episode {job}")
    pool = Doomed(1, work)
    pool.begin(0, 7)
    with pytest.raises(SainError, match=rf"episode 7 ended {LIVES} workers, .* exit code -9"):
        while True:
            pool.finished()
    pool.close()
    assert active_children() == []


def test_an_episode_that_cannot_be_run_is_an_error_of_the_collection(tmp_path) -> None:
    crowded = replace(SHORT, disks=5)
    errors = []
    for workers in (1, 2):
        with pytest.MonkeyPatch.context() as patch, pytest.raises(SainError) as caught:
            patch.setattr("sain_core.workers.pool._serve", _refuse)
            patch.setattr("sain_sim.collecting.episode.EpisodeRunner.run", _no_room)
            collect(CollectConfig(tmp_path, episodes=3, workers=workers, episode=crowded))
        errors.append(str(caught.value))
    assert errors == ["no room"] * 2 and active_children() == []


def _no_room(*_: object) -> EpisodeResult:
    raise SainError("no room")


def _refuse(pipe, *_: object) -> None:
    pipe.recv()
    pipe.send(SainError("no room"))


def children(process: int) -> list[int]:
    return [
        int(pid) for pid in Path(f"/proc/{process}/task/{process}/children").read_text().split()
    ]


def wait_for(done, what: str) -> None:
    end = time.monotonic() + 120
    while not done():
        assert time.monotonic() < end, f"no {what}"
        time.sleep(0.02)


def test_a_collection_killed_as_a_whole_goes_on_and_leaves_no_process(whole, tmp_path) -> None:
    _, expected = whole
    arguments = ["--out", str(tmp_path), "--episodes", "5", "--seed", "4", "--pushes", "3"]
    command = [
        str(executable("sain_sim", "collect")),
        *arguments,
        "--workers",
        "2",
    ]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    journal = tmp_path / JOURNAL_FILE
    wait_for(lambda: journal.exists() and journal.read_text().count("\n") >= 2, "episodes")
    workers = children(process.pid)
    process.kill()
    process.wait()
    assert workers and content(tmp_path) != expected
    wait_for(lambda: not any(Path(f"/proc/{pid}").exists() for pid in workers), "end of workers")
    assert main(arguments) == 0
    assert content(tmp_path) == expected
