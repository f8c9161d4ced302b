"""Definitions of messages of this checkout, also where the environment was built before them."""

import os
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "src" / "sain_interfaces"


def find_own(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let definitions that are not installed be found in a prefix in this folder."""
    share = folder / "prefix" / "share"
    share.mkdir(parents=True)
    (share / PACKAGE.name).symlink_to(PACKAGE)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(share.parent), prepend=os.pathsep)
