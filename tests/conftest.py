"""For all tests: shapes and types of our own functions are checked while they run."""

import os
import sys
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pytest
from beartype import BeartypeConf, FrozenDict, beartype
from hypothesis import settings
from jaxtyping import install_import_hook

from tests.workers import (  # noqa: F401 - these are hooks
    pytest_collection_modifyitems,
    pytest_xdist_auto_num_workers,
    pytest_xdist_make_scheduler,
)

if TYPE_CHECKING:
    from tests.graph import Graph

PACKAGES = (
    "sain_core", "sain_sim", "sain_model", "sain_mppi", "sain_bags", "sain_eval", "sain_bringup",
)  # fmt: skip
pytest_plugins = ["tests.hexagon"]
COMPILED = "_kernels"  # modules that Numba compiles: it does not take decorated functions


def checked_modules(package: str) -> list[str]:
    """Return the modules of a package whose functions can be checked."""
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        return []
    root = Path(spec.submodule_search_locations[0])
    names = [path.relative_to(root).with_suffix("") for path in sorted(root.rglob("*.py"))]
    return [
        ".".join([package, *name.parts])
        for name in names
        if name.name != "__init__" and not name.name.endswith(COMPILED)
    ]


# An int will do for a float. Methods are decorated one by one, so that beartype cannot know what
# their `Self` is; and numpy gives a scalar where an array would have no dimensions.
ACCEPTED = FrozenDict({Self: object, np.ndarray: np.ndarray | np.generic})
CHECKS = BeartypeConf(is_pep484_tower=True, hint_overrides=ACCEPTED)


def checked_when_called(function: Callable[..., Any]) -> Callable[..., Any]:
    """Check types with beartype. Making a check takes 3 ms, and most functions are never called."""
    check: Callable[..., Any] | None = None

    def call(*args: Any, **kwargs: Any) -> Any:
        nonlocal check
        if check is None:
            check = beartype(function, conf=CHECKS)
        return check(*args, **kwargs)

    return call


def switch_checks_on() -> None:
    """Check shapes with jaxtyping and types with beartype."""
    checker = ModuleType("sain_type_checker")
    checker.check = checked_when_called  # type: ignore[attr-defined]
    sys.modules[checker.__name__] = checker
    modules = [name for package in PACKAGES for name in checked_modules(package)]
    install_import_hook(modules, "sain_type_checker.check")


switch_checks_on()
settings.register_profile("sain", deadline=None, max_examples=50, derandomize=True)
settings.load_profile("sain")


@pytest.fixture(scope="session")
def ros_domain() -> Iterator[int]:
    """A ROS domain that no other test session on this machine uses, and no graph outside it."""
    import domain_coordinator

    names = ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE")
    before = {name: os.environ.get(name) for name in names}
    with domain_coordinator.domain_id() as domain:
        os.environ.update(dict(zip(names, (str(domain), "LOCALHOST"), strict=True)))
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
