"""What the tests of the workspace share: where things are, and a checkout small enough to break."""

import shutil
from pathlib import Path

import pytest

from tests.paths import ROOT


@pytest.fixture
def root():
    """The checkout's root."""
    return ROOT


@pytest.fixture
def make_checkout(tmp_path):
    """Makes a checkout with the real set-up scripts and no packages, in a folder so named."""

    def make(name: str = "checkout") -> Path:
        checkout = tmp_path / name
        shutil.copytree(ROOT / "src/sain_interfaces", checkout / "src/sain_interfaces")
        (checkout / "ros2_ws").mkdir()
        (checkout / "ros2_ws" / "src").symlink_to("../src")
        shutil.copy2(ROOT / "env", checkout / "env")
        for name in ("pyproject.toml", "requirements.txt"):
            shutil.copy2(ROOT / name, checkout / name)
        shutil.copytree(ROOT / "tools", checkout / "tools")
        return checkout

    return make
