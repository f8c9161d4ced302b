"""The lock: exact, for every Python, of all groups, and without the name of a host."""

import re

import pytest

from tests.paths import ROOT
from tests.workspace.source_tree import PYPROJECT, names

LOCK = (ROOT / "requirements.txt").read_text()
LINE = re.compile(r"^([\w.-]+)==(\S+)(?: ; (.+))?$", re.MULTILINE)
LOCKED = {match[1].lower() for match in LINE.finditer(LOCK)}
UNLOCKED = set(PYPROJECT["tool"]["uv"]["exclude-dependencies"]) | {"torch"}


def test_every_line_pins_a_version_and_names_no_host():
    lines = [line for line in LOCK.splitlines() if line and not line.lstrip().startswith("#")]
    assert [line for line in lines if not LINE.fullmatch(line)] == []
    assert "://" not in LOCK


@pytest.mark.parametrize("group", ["project", *PYPROJECT["dependency-groups"]])
def test_what_is_asked_for_is_locked(group):
    asked = PYPROJECT["dependency-groups"].get(group) or PYPROJECT["project"]["dependencies"]
    assert {
        re.sub(r"[-_.]+", "-", name).lower() for name in names(asked)
    } - LOCKED - UNLOCKED == set()


def test_what_is_pinned_is_locked_with_that_version():
    lists = [PYPROJECT["project"]["dependencies"], *PYPROJECT["dependency-groups"].values()]
    lists.append(PYPROJECT["tool"]["uv"]["override-dependencies"])
    pins = [re.match(r"([\w.-]+)==([\w.]+)", str(line)) for one in lists for line in one]
    locked = {(match[1].lower(), match[2]) for match in LINE.finditer(LOCK)}
    named = {(re.sub(r"[-_.]+", "-", pin[1]).lower(), pin[2]) for pin in pins if pin}
    assert {pin for pin in named if pin[0] not in UNLOCKED} - locked == set(), "run make lock"


def test_nothing_is_installed_again_that_the_tests_have_brought():
    script = (ROOT / "tools/setup.sh").read_text()
    brought = re.search(r"test \]\] \|\| echo ([a-z ]*)\)", script)[1]
    groups = PYPROJECT["dependency-groups"]["test"]
    included = {group["include-group"] for group in groups if isinstance(group, dict)}
    assert set(brought.split()) == included | {"train"}
