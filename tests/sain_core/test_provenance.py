import re
import sys
from pathlib import Path

import pytest

from sain_core import storage


def test_the_commit_is_that_of_this_tree_or_unknown() -> None:
    assert re.fullmatch(r"[0-9a-f]{40}(-dirty)?|unknown", storage.git_commit())


def test_outside_a_repository_the_commit_is_unknown(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(storage, "__file__", str(tmp_path / "storage.py"))
    assert storage.git_commit() == "unknown"


def test_versions_name_what_is_installed_and_what_is_not() -> None:
    found = storage.versions("numpy", "no_such_package")
    assert found["python"].startswith(f"{sys.version_info.major}.{sys.version_info.minor}.")
    assert re.match(r"\d+\.\d+", found["numpy"])
    assert found["no_such_package"] == "unknown"


def test_the_command_can_be_given_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["/somewhere/train", "--out", "my data"])
    assert storage.command() == "train --out 'my data'"
    again = "ros2 run sain_model train --out 'my data'"
    assert storage.ros2_command("sain_model", "train") == again


def test_a_recording_states_how_it_was_made() -> None:
    about = storage.provenance("sain_core")
    assert set(about) == {"command", "commit", "version", "python", "machine"}
    assert all(about.values())
    assert re.search(r", \d+ cores$", storage.processor())
