"""ROS parameters made from `Config` dataclasses, so that a default stands in one place only.

A nested config becomes a prefix: ``planner.samples``. Parameters are read at the start and
read-only from then on, but for those that are declared `live`: `LiveParameters` follows them.
`rclpy` ignores an override that nobody declares, in silence; here it stops the node and names what
was probably meant.
"""

import dataclasses
import sys
from array import array
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, TypeVar, get_args, get_origin, get_type_hints

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

from sain_core.config import Config, check_field
from sain_core.errors import ConfigError, UntrustedFileError
from sain_core.untrusted import YAML_BYTES, read_regular

OPTION: Final = "--params-file"


def check_parameter_files(arguments: Sequence[str] | None) -> None:
    """Check the files that arguments name, or those of the process; rcl waits for any FIFO.

    Raises:
        ConfigError: one is no regular file, or too large.
    """
    for option, name in pairwise(sys.argv if arguments is None else arguments):
        if option != OPTION:
            continue
        try:
            read_regular(Path(name), YAML_BYTES)
        except UntrustedFileError as error:
            raise ConfigError(f"{OPTION} {name} is not read: {error}") from error
        except OSError:
            return  # rcl says why


C = TypeVar("C", bound=Config)

LARGEST_FLOAT = 1.7976931348623157e308
LARGEST_INT = 2**63 - 1
TYPE_NAMES = {float: "a number", int: "an integer", bool: "true or false", str: "a string"}
READ_ONCE = "read at the start: start the node anew to change it"
ROS_OWN = ("use_sim_time", "start_type_description_service", "qos_overrides")


def read_parameters(node: Node, config_class: type[C], default: C | None = None) -> C:
    """Declare the parameters of a node, all of them, and return their values.

    What is not given is as in `default`, or as in the class if None.

    Raises:
        ConfigError: an unknown name, a wrong type, or a value that is not allowed.
    """
    default = config_class() if default is None else default
    known = _names(config_class, "")
    for name in node._parameter_overrides:
        if name not in known and name.split(".")[0] not in ROS_OWN:
            raise _unknown(name, known)
    return _declare(node, default, "", False)


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
        return _replaced(self._settings, {one.name: one.value for one in parameters}, "")


def _replaced(settings: C, values: dict[str, Any], prefix: str) -> C:
    """Return settings with the values that have a name there."""
    kinds, changes = _fields(type(settings)), {}
    for item in dataclasses.fields(settings):
        name, value = prefix + item.name, getattr(settings, item.name)
        if isinstance(value, Config):
            changes[item.name] = _replaced(value, values, f"{name}.")
        elif name in values:
            changes[item.name] = _converted(name, kinds[item.name], values[name])
            check_field(f"parameter {name!r}", item, changes[item.name])
    return dataclasses.replace(settings, **changes)


def _names(config_class: type[Config], prefix: str) -> list[str]:
    names: list[str] = []
    for name, kind in _fields(config_class).items():
        nested = isinstance(kind, type) and issubclass(kind, Config)
        names += _names(kind, f"{prefix}{name}.") if nested else [prefix + name]
    return names


def _fields(config_class: type[Config]) -> dict[str, Any]:
    hints = get_type_hints(config_class)
    return {item.name: hints[item.name] for item in dataclasses.fields(config_class)}


def _unknown(name: str, known: list[str]) -> ConfigError:
    by_last = [other for other in known if other.split(".")[-1] == name.split(".")[-1]]
    near = by_last or get_close_matches(name, known, n=3) or sorted(known)
    return ConfigError(f"parameter {name!r} is unknown; near it: {', '.join(near[:5])}")


def _declare(node: Node, default: C, prefix: str, live: bool) -> C:
    values: dict[str, Any] = {}
    kinds = _fields(type(default))
    for item in dataclasses.fields(default):
        name, value = prefix + item.name, getattr(default, item.name)
        may_change = live or item.metadata.get("live", False)
        if isinstance(value, Config):
            values[item.name] = _declare(node, value, f"{name}.", may_change)
        else:
            descriptor = _descriptor(item, kinds[item.name], may_change)
            values[item.name] = _declare_one(node, name, item, value, descriptor, kinds[item.name])
    return type(default)(**values)


def _declare_one(
    node: Node,
    name: str,
    item: "dataclasses.Field[Any]",
    default: Any,
    descriptor: ParameterDescriptor,
    kind: Any,
) -> Any:
    override = node._parameter_overrides.get(name)
    value = default if override is None else _converted(name, kind, override.value)
    check_field(f"parameter {name!r}", item, value)
    ros_value = list(value) if isinstance(value, tuple) else value
    node.declare_parameter(name, ros_value, descriptor, ignore_override=True)
    return value


def _converted(name: str, kind: Any, value: Any) -> Any:
    """Return the value in the field's type; an integer will do for a number."""
    if get_origin(kind) is tuple:
        if not isinstance(value, list | tuple | array):
            raise ConfigError(f"parameter {name!r} is {value!r}; it must be a list")
        size = len(get_args(kind))
        if get_args(kind)[-1] is not Ellipsis and len(value) != size:
            raise ConfigError(f"parameter {name!r} has {len(value)} values; it must have {size}")
        return tuple(_converted(name, get_args(kind)[0], element) for element in value)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not kind:
        what = TYPE_NAMES.get(kind, kind)
        raise ConfigError(f"parameter {name!r} is {value!r}; it must be {what}")
    return value


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
    if kind is float:
        bounds = FloatingPointRange(
            from_value=-LARGEST_FLOAT if low is None else float(low),
            to_value=LARGEST_FLOAT if high is None else float(high),
        )
        descriptor.floating_point_range = [bounds]
    elif kind is int:
        limits = IntegerRange(
            from_value=-LARGEST_INT if low is None else int(low),
            to_value=LARGEST_INT if high is None else int(high),
        )
        descriptor.integer_range = [limits]
