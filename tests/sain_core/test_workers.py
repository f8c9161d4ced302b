"""Workers end with the process that started them, also when it is killed."""

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import pytest

from sain_core.workers import FunctionRunner, Software, Work

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


def work_of(function: Callable[[Any], Any]) -> Work[Any, Any]:
    return Work(partial(FunctionRunner, function), Software(("sain_core",), ("numpy",)), str)


def wait_here(folder: Path) -> None:
    (folder / str(os.getpid())).touch()
    sleep(100.0)


def alive(folder: Path) -> list[int]:
    return [int(path.name) for path in folder.iterdir() if Path("/proc", path.name).exists()]


def wait_until(condition: Callable[[], bool]) -> bool:
    end = monotonic() + 150.0
    while not condition():
        if monotonic() > end:
            return False
        sleep(0.05)
    return True


@pytest.mark.parametrize("ray", ["", "local"])
def test_no_worker_outlives_a_process_that_is_killed(tmp_path, ray) -> None:
    (tmp_path / "program.py").write_text(PROGRAM)
    (tmp_path / "workers").mkdir()
    started = [sys.executable, str(tmp_path / "program.py"), str(tmp_path / "workers"), ray]
    with tempfile.TemporaryDirectory(
        prefix="t-",
        dir="/tmp",
        ignore_cleanup_errors=True,  # sockets: short paths
    ) as folder:
        here = {"PYTHONPATH": os.pathsep.join(sys.path), "TMPDIR": folder}
        with subprocess.Popen(started, env={**os.environ, **here}) as it:
            assert wait_until(lambda: len(alive(tmp_path / "workers")) == 2)
            it.send_signal(signal.SIGKILL)
        assert wait_until(lambda: not alive(tmp_path / "workers"))
