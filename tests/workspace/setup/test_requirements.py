"""The pinned requirements: exact, locked, and enough for what the code imports."""

import re
from pathlib import Path

import pytest

from tests.paths import ROOT
from tests.workspace.source_tree import PYTHON_PACKAGES, requirements_of

REQUIREMENTS = ROOT / "requirements"
PYTHONS = ("3.11", "3.12", "3.13")


def pins(path: Path) -> dict[str, str]:
    """Name -> version, with names as the index compares them."""
    lines = [line.split("#")[0].strip() for line in path.read_text().splitlines()]
    wanted = [re.fullmatch(r"([\w.-]+)==([\w.]+)", line) for line in lines if line]
    assert None not in wanted, f"{path.name}: every line must read name==version"
    return {re.sub(r"[-_.]+", "-", match[1]).lower(): match[2] for match in wanted}


def locks(python: str) -> dict[str, dict[str, str]]:
    """What is locked for a Python, by kind."""
    return {kind: pins(REQUIREMENTS / f"lock-{python}-{kind}.txt") for kind in ("ros", "python")}


def locked(python: str) -> dict[str, str]:
    both = locks(python)
    return both["ros"] | both["python"]


@pytest.mark.parametrize("python", PYTHONS)
@pytest.mark.parametrize("file", ["ros.in", "python.in", "as_is.txt"])
def test_what_is_asked_for_is_what_is_locked(file, python):
    asked, found = pins(REQUIREMENTS / file), locked(python)
    assert {name: found.get(name) for name in asked} == asked, "run tools/lock.py"


@pytest.mark.parametrize("package", PYTHON_PACKAGES)
def test_what_a_package_needs_is_pinned(package):
    files = ("ros.in", "python.in", "bullet.txt", "robots.txt", "as_is.txt", "torch.txt")
    pinned = {name for file in files for name in pins(REQUIREMENTS / file)}
    assert {name.lower() for name in requirements_of(package)} <= pinned
