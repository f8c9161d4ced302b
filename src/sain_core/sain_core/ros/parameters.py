"""ROS parameters made from `Config` dataclasses, so that a default stands in one place only.

A nested config becomes a prefix: ``planner.samples``. Parameters are read at the start and
read-only from then on, but for those that are declared `live`: `LiveParameters` follows them.
`rclpy` ignores an override that nobody declares, in silence; here it stops the node and names what
was probably meant.
"""

import dataclasses
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, TypeVar, get_origin

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from sain_core.config import Config, check_field, settings_of, typed, with_settings
from sain_core.errors import ConfigError, UntrustedFileError
from sain_core.guarding.documents import read_yaml
from sain_core.guarding.plugins import nearest

OPTION: Final = "--params-file"


def check_parameter_files(arguments: Sequence[str]) -> None:
    """Check the files that arguments name: rcl would wait for a FIFO."""
    for option, name in pairwise(arguments):
        if option != OPTION:
            continue
        try:
            read_yaml(Path(name))
        except UntrustedFileError as error:
            raise ConfigError(f"{OPTION} {name} is not read: {error}") from error
        except OSError:
            return  # rcl says why


C = TypeVar("C", bound=Config)

LARGEST_FLOAT = 1.7976931348623157e308
LARGEST_INT = 2**63 - 1
READ_ONCE = "read at the start: start the node anew to change it"
ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides")


def read_parameters(node: Node, config_class: type[C]) -> C:
    """Declare the parameters of a node, all of them, and return their values.

    Raises `ConfigError`: an unknown name, a wrong type, or a value that is not allowed.
    """
    settings = config_class()
    names = [one.name for one in settings_of(settings)]
    overrides = node._parameter_overrides
    for name in overrides:
        if name not in names and name.split(".")[0] not in ROS_OWN:
            by_last = [other for other in names if other.split(".")[-1] == name.split(".")[-1]]
            near = by_last or nearest(name, names, count=3) or sorted(names)
            raise ConfigError(f"parameter {name!r} is unknown; near it: {', '.join(near[:5])}")
    given = {name: override.value for name, override in overrides.items() if name in names}
    values = _typed(settings, given, check_all=True)
    for name, item, kind, _, live in settings_of(settings):
        value = list(values[name]) if isinstance(values[name], tuple) else values[name]
        node.declare_parameter(name, value, _descriptor(item, kind, live), ignore_override=True)
    return with_settings(settings, values)


class LiveParameters:
    """Follows the live parameters of a node while it runs.

    rclpy itself refuses other types, values out of range and read-only parameters. All that a
    `Config` checks besides is refused here, with its reason.
    """

    def __init__(self, node: Node, settings: C, use: Callable[[C], None]) -> None:
        """Call `use` with the new settings after each change, on the executor's thread."""
        self._settings: Any = settings
        self._use = use
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._follow)

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            self._changed(parameters)
        except ConfigError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _follow(self, parameters: list[Parameter]) -> None:
        changed = self._changed(parameters)
        if changed != self._settings:
            self._settings = changed
            self._use(changed)

    def _changed(self, parameters: list[Parameter]) -> Any:
        values = {one.name: one.value for one in parameters}
        return with_settings(self._settings, _typed(self._settings, values))


def _typed(settings: Config, values: dict[str, Any], check_all: bool = False) -> dict[str, Any]:
    """Return given values in the types of their fields, checked; others if `check_all`."""
    checked = {}
    for name, item, kind, value, _ in settings_of(settings):
        what = f"parameter {name!r}"
        if name in values or check_all:
            try:
                checked[name] = typed(what, kind, values[name]) if name in values else value
            except TypeError as error:
                raise ConfigError(str(error)) from error
            check_field(what, item, checked[name])
    return checked


def _descriptor(item: "dataclasses.Field[Any]", kind: Any, live: bool) -> ParameterDescriptor:
    about = item.metadata
    unit = f" [{about['unit']}]" if about.get("unit") else ""
    choices = about.get("choices")
    constraints = [f"one of {', '.join(map(str, choices))}"] if choices else []
    descriptor = ParameterDescriptor(
        description=f"{about.get('description', '')}{unit}",
        additional_constraints="; ".join(constraints if live else [*constraints, READ_ONCE]),
        read_only=not live,
        dynamic_typing=get_origin(kind) is tuple,  # an empty list has no type of its own
    )
    low, high = about.get("minimum"), about.get("maximum")
    if low is not None or high is not None:
        _set_range(descriptor, kind, low, high)
    return descriptor


def _set_range(
    descriptor: ParameterDescriptor, kind: Any, low: float | None, high: float | None
) -> None:
    if kind not in (int, float):
        return
    limits, most = (
        (FloatingPointRange(), LARGEST_FLOAT) if kind is float else (IntegerRange(), LARGEST_INT)
    )
    limits.from_value = -most if low is None else kind(low)
    limits.to_value = most if high is None else kind(high)
    name = "floating_point_range" if kind is float else "integer_range"
    setattr(descriptor, name, [limits])
