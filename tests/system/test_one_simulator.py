"""Simulators as processes: of several that start together one remains, and a killed one leaves."""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import pytest

pytestmark = pytest.mark.system

CODE = "import sys; from sain_sim.commands import sim_node; sys.exit(sim_node())"
PATIENCE = 60.0  # [s]
REFUSED = "sim_node: process {pid} (/sain/sim_node) executes pushes in namespace /sain"


@contextmanager
def started(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    command = [sys.executable, "-c", CODE, "--ros-args", *arguments]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        yield process
        process.terminate()


def test_of_three_that_start_together_one_remains(ros_domain):
    with ExitStack() as stack:
        processes = [stack.enter_context(started()) for _ in range(3)]
        end = time.monotonic() + PATIENCE
        while sum(one.poll() is None for one in processes) > 1 and time.monotonic() < end:
            time.sleep(0.1)
        time.sleep(1.0)
        assert sorted(str(one.poll()) for one in processes) == ["1", "1", "None"]
        (left,) = (one for one in processes if one.poll() is None)
        for process in processes:
            if process.poll() is not None:
                assert REFUSED.format(pid=left.pid) in process.stderr.read()
