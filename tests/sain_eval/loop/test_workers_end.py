"""Workers of an evaluation end with it, also when it is killed."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from time import monotonic, sleep

from sain_eval.loop.evaluation import run_on_workers

PROGRAM = """
import sys
from pathlib import Path
from tests.sain_eval.loop.test_workers_end import wait_here
from sain_eval.loop.evaluation import run_on_workers
if __name__ == "__main__":
    list(run_on_workers(wait_here, [Path(sys.argv[1])] * 4, 2))
"""


def wait_here(folder: Path) -> None:
    (folder / str(os.getpid())).touch()
    sleep(60.0)


def alive(folder: Path) -> list[int]:
    return [int(path.name) for path in folder.iterdir() if Path("/proc", path.name).exists()]


def wait_until(condition) -> bool:
    end = monotonic() + 30.0
    while not condition():
        if monotonic() > end:
            return False
        sleep(0.05)
    return True


def test_no_worker_outlives_an_evaluation_that_is_killed(tmp_path):
    (tmp_path / "program.py").write_text(PROGRAM)
    (tmp_path / "workers").mkdir()
    started = [sys.executable, str(tmp_path / "program.py"), str(tmp_path / "workers")]
    with subprocess.Popen(
        started, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    ) as it:
        assert wait_until(lambda: len(alive(tmp_path / "workers")) == 2)
        it.send_signal(signal.SIGKILL)
    assert wait_until(lambda: not alive(tmp_path / "workers"))


def test_one_worker_is_this_process():
    assert list(run_on_workers(lambda job: (os.getpid(), job), [1, 2], 1)) == [
        (os.getpid(), 1),
        (os.getpid(), 2),
    ]
