"""Work on several processes: its results, its errors, and its end."""

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from multiprocessing import active_children
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest

from sain_core.errors import SainError
from sain_core.workers import FunctionRunner, Work, WorkerOptions, run_on_workers

PROGRAM = """
import sys
from pathlib import Path
from sain_core.workers import WorkerOptions
from sain_core.workers import run_on_workers
from tests.sain_core.test_workers import wait_here, work_of
if __name__ == "__main__":
    two = WorkerOptions(workers=2, ray=sys.argv[2])
    list(run_on_workers(work_of(wait_here), [Path(sys.argv[1])] * 4, two))
"""


def work_of(function: Callable[[Any], Any]) -> Work:
    return Work(partial(FunctionRunner, function), ("sain_core",), ("numpy",))


def wait_here(folder: Path) -> None:
    (folder / str(os.getpid())).touch()
    sleep(100.0)


def alive(folder: Path) -> list[int]:
    return [int(path.name) for path in folder.iterdir() if Path("/proc", path.name).exists()]


def wait_until(condition: Callable[[], bool], seconds: float = 150.0) -> bool:
    end = monotonic() + seconds
    while not condition():
        if monotonic() > end:
            return False
        sleep(0.05)
    return True


def square_of(job: int) -> int:
    sleep(0.02 * (job % 3))
    return job**2


def refuse_five(job: int) -> int:
    if job == 5:
        raise SainError("no room for 5")
    return job


def end_at_five(job: int) -> int:
    if job == 5:
        os.kill(os.getpid(), signal.SIGKILL)
    return job


@pytest.mark.parametrize("workers", [1, 2])
def test_results_do_not_depend_on_the_number_of_workers(workers):
    options = WorkerOptions(workers=workers)
    assert list(run_on_workers(work_of(square_of), range(30), options)) == [n**2 for n in range(30)]
    unordered = run_on_workers(work_of(square_of), range(30), options, ordered=False)
    assert sorted(unordered) == [n**2 for n in range(30)]
    assert list(run_on_workers(work_of(square_of), [], options)) == []
    assert active_children() == []


def test_an_error_of_a_job_ends_the_work():
    for workers in (1, 2):
        with pytest.raises(SainError, match=r"^no room for 5$"):
            list(run_on_workers(work_of(refuse_five), range(9), WorkerOptions(workers=workers)))
        assert active_children() == []


def test_a_killed_worker_is_named_in_one_line():
    died = r"^a worker process died with exit code SIGKILL\(-9\) after \d of 9 jobs; .* workers$"
    with pytest.raises(SainError, match=died):
        list(run_on_workers(work_of(end_at_five), range(9), WorkerOptions(workers=2)))
    assert active_children() == []


def test_an_error_of_the_caller_ends_workers_in_the_middle_of_a_job(tmp_path):
    work, two = work_of(wait_unless_first), WorkerOptions(workers=2)
    results = run_on_workers(work, [tmp_path] * 4, two, ordered=False)
    assert next(results) == 0
    results.close()
    assert active_children() == []


def wait_unless_first(folder: Path) -> int:
    try:
        (folder / "first").touch(exist_ok=False)
    except FileExistsError:
        sleep(100.0)
    return 0


@pytest.mark.parametrize("ray", ["", "local"])
def test_no_worker_outlives_a_process_that_is_killed(tmp_path, ray):
    (tmp_path / "program.py").write_text(PROGRAM)
    (tmp_path / "workers").mkdir()
    started = [sys.executable, str(tmp_path / "program.py"), str(tmp_path / "workers"), ray]
    short = {"prefix": "t-", "dir": "/tmp", "ignore_cleanup_errors": True}  # for paths of sockets
    with tempfile.TemporaryDirectory(**short) as folder:
        here = {"PYTHONPATH": os.pathsep.join(sys.path), "TMPDIR": folder}
        with subprocess.Popen(started, env={**os.environ, **here}) as it:
            assert wait_until(lambda: len(alive(tmp_path / "workers")) == 2)
            it.send_signal(signal.SIGKILL)
        assert wait_until(lambda: not alive(tmp_path / "workers"))
