"""The compose file: one service a node, each of which exists and can talk to the others."""

import re

import pytest
import yaml

from tests.paths import ROOT
from tests.workspace.source_tree import PYTHON_PACKAGES, console_scripts

DOCKER = ROOT / "docker"
SERVICES = yaml.safe_load((DOCKER / "compose.yaml").read_text())["services"]
NODES = {
    ("sain_sim", "sim_node"),
    ("sain_model", "model_node"),
    ("sain_mppi", "mppi_node"),
    ("sain_bags", "record"),
}
EXECUTABLES = {(package, name) for package in PYTHON_PACKAGES for name in console_scripts(package)}


def started_by(service: dict) -> tuple[str, str]:
    """Package and executable, or launch file, of a service's command."""
    return re.search(r"ros2 (?:run|launch) (\S+) (\S+)", service["command"]).groups()


def test_one_service_a_node():
    by_default = [started_by(s) for s in SERVICES.values() if "profiles" not in s]
    assert sorted(by_default) == sorted(NODES)


@pytest.mark.parametrize("name", SERVICES)
def test_what_a_service_starts_exists(name, root):
    package, started = started_by(SERVICES[name])
    if started.endswith(".launch.py"):
        assert (root / "src" / package / "launch" / started).exists()
    else:
        assert (package, started) in EXECUTABLES
