"""How the tests are divided among processes: a file is a unit, some files are one unit together.

A whole run takes a worker for every core, up to four. What is named on the command line runs in one
process, where a worker's start would cost more than it saves; ``-n 2`` says otherwise.
"""

import os
import subprocess
import sys
from typing import Final

import pytest
from _pytest.config import Config
from xdist.scheduler import LoadScopeScheduling

MOST: Final = 4
TOGETHER: Final = {  # files that must not run beside one another, by a part of their path
    "graph": ("tests/system/", "/ros/"),
    "browser": ("sain_bags/report/",),
    "processes": ("sain_bringup/", "collecting/", "tests/workspace/"),
}
# The longest come first, so that no worker is left with one when all others are done.
FIRST: Final = ("tests/system/", "/ros/", "tests/examples/", "/dataset/formats/", "/training/")


class ByFile(LoadScopeScheduling):
    """Gives each worker one unit after another, in the order of the collection."""

    def _split_scope(self, nodeid: str) -> str:
        path = nodeid.partition("::")[0]
        for unit, parts in TOGETHER.items():
            if any(part in path for part in parts):
                return unit
        return path


def pytest_xdist_auto_num_workers(config: Config) -> int:
    """Return how many workers ``-n auto`` starts; 0 is this process alone."""
    narrowed = config.option.keyword or config.option.markexpr or config.option.lf
    if narrowed or config.args_source is not Config.ArgsSource.TESTPATHS:
        return 0
    return min(len(os.sched_getaffinity(0)), MOST)


def pytest_xdist_make_scheduler(config: Config, log: object) -> ByFile:
    return ByFile(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: _place(item.nodeid))


def _place(nodeid: str) -> int:
    return next((place for place, part in enumerate(FIRST) if part in nodeid), len(FIRST))


@pytest.hookimpl(tryfirst=True)
def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile all kernels before the workers start, which would each compile them."""
    if session.config.option.numprocesses:
        command = [sys.executable, "-m", "sain_model.cli.compile_kernels"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
