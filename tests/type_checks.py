"""Shapes and types of our own functions are checked in ``pytest --all``: jaxtyping with beartype.

Checked is what has an array with a shape in its annotations: mypy sees all other types without a
run. A check costs about 30 us a call and 5 ms to make. So it is made when a function is first
called. In each test the first calls of every function are checked, and then one of many. A function
counts its own calls: to look them up by its code would cost more than the call.

A function inside another is made anew at each call of that, and its check with it, for 5 ms. So
in each test the first that are made are checked, and then one of many.
"""

import dataclasses
import functools
import inspect
import sys
from collections import Counter
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, Final, Self, get_args

import jaxtyping
import numpy as np
from beartype import BeartypeConf, FrozenDict, beartype

CHECK_SHAPES: Final = "SAIN_CHECK_SHAPES"  # the variable that switches them on
PACKAGES: Final = (
    "sain_core", "sain_arm", "sain_sim", "sain_model", "sain_mppi", "sain_bags", "sain_eval",
    "sain_lab", "sain_gym", "sain_bringup", "sain_vision",
)  # fmt: skip
COMPILED: Final = "_kernels"  # modules that Numba compiles: it does not take decorated functions
ALWAYS, SELDOM = 2, 200  # calls of a function in a test: all checked, and then one of these
INSIDE = 1  # of the functions of one code that are made in a test inside others: all checked
# An int will do for a float. Methods are decorated one by one, so that beartype cannot know what
# their `Self` is; and numpy gives a scalar where an array would have no dimensions.
ACCEPTED: Final = FrozenDict({Self: object, np.ndarray: np.ndarray | np.generic})
CONFIG: Final = BeartypeConf(is_pep484_tower=True, hint_overrides=ACCEPTED)

test = 0  # the number of the test that runs
made: Counter[CodeType] = Counter()  # functions inside others, in this test
make_check = jaxtyping.jaxtyped


def pytest_runtest_setup() -> None:
    global test
    test += 1
    made.clear()


def switch_on() -> None:
    """Check all functions of our packages that are imported from now on."""
    checker = ModuleType("sain_type_checker")
    checker.check = functools.partial(beartype, conf=CONFIG)  # type: ignore[attr-defined]
    sys.modules[checker.__name__] = checker
    jaxtyping.jaxtyped = decorate  # which the import hook puts on each function and class
    modules = [name for package in PACKAGES for name in _modules(package)]
    jaxtyping.install_import_hook(modules, "sain_type_checker.check")


def decorate(*, typechecker: Any) -> Callable[[Any], Any]:
    """Return a decorator of functions and dataclasses."""

    def decorator(item: Any) -> Any:
        if dataclasses.is_dataclass(item):
            if _has_shape(item.__init__):
                item.__init__ = _checked_often_enough(item.__init__, typechecker)
            return item
        if not inspect.isfunction(item) or not _has_shape(item):
            return item
        if "<locals>" in item.__qualname__:
            made[item.__code__] += 1
            if made[item.__code__] > INSIDE and made[item.__code__] % SELDOM:
                return item
        return _checked_often_enough(item, typechecker)

    return decorator


def _has_shape(item: Any) -> bool:
    """Tell whether an annotation names an array by its shape."""
    return any(map(_is_shaped, getattr(item, "__annotations__", {}).values()))


def _is_shaped(annotation: Any) -> bool:
    if isinstance(annotation, type) and issubclass(annotation, jaxtyping.AbstractArray):
        return True
    return any(map(_is_shaped, get_args(annotation)))


def _checked_often_enough(function: Any, typechecker: Any) -> Any:
    check: Any = None
    calls = counted = 0  # in this test

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        nonlocal check, calls, counted
        calls, counted = calls + 1 if counted == test else 1, test
        if calls > ALWAYS and calls % SELDOM:
            return function(*args, **kwargs)
        if check is None:
            check = make_check(function, typechecker=typechecker)
        return check(*args, **kwargs)

    return call


def _modules(package: str) -> list[str]:
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
