"""For all tests: type checks, their division among workers, and a graph in a domain of its own."""

import os
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from tests.type_checks import CHECK_SHAPES, pytest_runtest_setup, switch_on  # noqa: F401 - a hook
from tests.workers import (  # noqa: F401 - these are hooks
    pytest_addoption,
    pytest_collection_modifyitems,
    pytest_ignore_collect,
    pytest_runtest_call,
    pytest_terminal_summary,
    pytest_xdist_auto_num_workers,
    pytest_xdist_make_scheduler,
)

if TYPE_CHECKING:
    from tests.graph import Graph

pytest_plugins = ["tests.hexagon"]

if "--all" in sys.argv:
    os.environ[CHECK_SHAPES] = "yes"  # for the workers, too
if os.environ.get(CHECK_SHAPES):
    switch_on()
settings.register_profile("sain", deadline=None, max_examples=50, derandomize=True)
settings.load_profile("sain")


@pytest.fixture(scope="session")
def ros_domain() -> Iterator[int]:
    """A ROS domain that no other test session on this machine uses, and no graph outside it."""
    import domain_coordinator

    from sain_core.guarding import lifetime

    names = ("ROS_DOMAIN_ID", lifetime.RANGE, lifetime.FROM_PROFILE, *lifetime.PROFILES)
    before = {name: os.environ.get(name) for name in names}
    with domain_coordinator.domain_id() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        os.environ[lifetime.RANGE] = "LOCALHOST"
        lifetime.stay_on_this_host()
        yield int(domain)
    for name, value in before.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value


@pytest.fixture
def graph(ros_domain: int) -> Iterator["Graph"]:
    """A graph with nobody in it but a bystander."""
    from tests.graph import Graph  # not before the domain is set, nor where no test needs ROS

    graph = Graph(ros_domain)
    yield graph
    graph.close()
