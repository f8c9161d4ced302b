"""The pinned requirements: exact, locked, and enough for what the code imports."""

import re
import sys
from pathlib import Path

import pytest

from tests.paths import ROOT
from tests.workspace.source_tree import PYTHON_PACKAGES, requirements_of

REQUIREMENTS = ROOT / "requirements"
LOCKS = {kind: REQUIREMENTS / f"lock-3.11-{kind}.txt" for kind in ("ros", "python")}


def pins(path: Path) -> dict[str, str]:
    """Name -> version, with names as the index compares them."""
    lines = [line.split("#")[0].strip() for line in path.read_text().splitlines()]
    wanted = [re.fullmatch(r"([\w.-]+)==([\w.]+)", line) for line in lines if line]
    assert None not in wanted, f"{path.name}: every line must read name==version"
    return {re.sub(r"[-_.]+", "-", match[1]).lower(): match[2] for match in wanted}


@pytest.mark.parametrize("file", ["ros.in", "python.in", "as_is.txt"])
def test_what_is_asked_for_is_what_is_locked(file):
    locked = pins(LOCKS["ros"]) | pins(LOCKS["python"])
    asked = pins(REQUIREMENTS / file)
    assert {name: locked.get(name) for name in asked} == asked, "run ./env python tools/lock.py"


def test_no_package_is_in_both_locks():
    """They are installed side by side."""
    assert pins(LOCKS["ros"]).keys() & pins(LOCKS["python"]).keys() == set()


def test_torch_is_asked_for_exactly_and_locked_nowhere():
    assert set(pins(REQUIREMENTS / "torch.txt")) == {"torch"}
    assert "torch" not in pins(LOCKS["python"])


def test_colcon_gets_a_setuptools_that_it_can_use():
    assert int(pins(LOCKS["ros"])["setuptools"].split(".")[0]) < 80


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_what_a_package_needs_is_pinned(package):
    files = ("ros.in", "python.in", "as_is.txt", "torch.txt")
    pinned = {name for file in files for name in pins(REQUIREMENTS / file)}
    assert {name.lower() for name in requirements_of(package)} <= pinned


@pytest.mark.skipif(sys.version_info[:2] != (3, 11), reason="the locks are for Python 3.11")
def test_what_is_installed_is_what_is_locked():
    from importlib.metadata import version

    locked = pins(LOCKS["ros"]) | pins(LOCKS["python"])
    assert {name: version(name) for name in locked} == locked
