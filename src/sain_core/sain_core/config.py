"""Settings: frozen dataclasses whose fields know their unit, meaning and allowed range.

The same dataclass is the constructor argument of the class it configures, the source of the
ROS parameters (`sain_core.ros.parameters`) and the source of the command line (``tyro``), so a
default stands in one place only.

    @dataclass(frozen=True)
    class ToolConfig(Config):
        radius: float = option(0.012, "radius of the stick", unit="m", minimum=0.001, maximum=0.05)
"""

import dataclasses
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, field
from math import isfinite, pi
from typing import Any, Final, Literal, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

from sain_core.errors import ConfigError
from sain_core.guarding.plugins import did_you_mean
from sain_core.guarding.untrusted import LONGEST_NAME, shown

T = TypeVar("T")
C = TypeVar("C", bound="Config")

TURN: Final = 6.29  # [rad], a full one, rounded up: beyond it an angle is in degrees
OTHER_UNITS: Final = {
    "m": ("millimetres", 1e-3),
    "kg": ("grams", 1e-3),
    "rad": ("degrees", pi / 180),
    "rad/s": ("degrees/s", pi / 180),
}
TYPE_NAMES: Final = {
    float: "a number", int: "an integer", bool: "true or false", str: "a string", tuple: "a list",
}  # fmt: skip
LARGEST: Final = 1e12  # number that a user's file may give where nothing else limits it
MOST_SEED: Final = 2**31 - 1  # so that it, and those counted on from it, fit in messages and rows


def option(
    default: T,
    description: str,
    *,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[Any, ...] | None = None,
    live: bool = False,
) -> T:
    """Declare a field of a `Config` with its unit, meaning and allowed values.

    One that is `live` may be changed, as a ROS parameter, while its node runs.
    """
    about = {
        "description": description,
        "unit": unit,
        "minimum": minimum,
        "maximum": maximum,
        "choices": choices,
        "live": live,
    }
    return field(default=default, metadata=about)


def required(description: str) -> Any:
    """Declare a field without a default; it comes before those with one."""
    return option(MISSING, description)


def live_group(default: T) -> T:
    """Declare nested settings of which each may be changed while its node runs."""
    return field(default=default, metadata={"live": True})


def describe_values(about: Mapping[str, Any]) -> str:
    """Return which values a field allows, from its metadata: ``a, b`` or ``1 to 5``; or ""."""
    if about.get("choices"):
        return ", ".join(map(str, about["choices"]))
    low, high = about.get("minimum"), about.get("maximum")
    if low is None and high is None:
        return ""
    if high is None:
        return f"at least {show_value(low)}"
    return (
        f"at most {show_value(high)}" if low is None else f"{show_value(low)} to {show_value(high)}"
    )


def show_value(value: object) -> str:
    """Return a value as YAML has it."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(show_value, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Config:
    """Base of every settings class: checks each field, or raises `ConfigError`."""

    def __post_init__(self) -> None:
        """Check every field, and those of nested settings are checked by themselves."""
        for item in dataclasses.fields(self):
            check_field(f"{type(self).__name__}.{item.name}", item, getattr(self, item.name))


def check_field(field_name: str, item: "dataclasses.Field[Any]", value: Any) -> None:
    """Check the value of one field, which errors call `field_name`; raises `ConfigError`."""
    unit = f" {item.metadata['unit']}" if item.metadata.get("unit") else ""
    choices = item.metadata.get("choices")
    if choices is not None and value not in choices:
        allowed = ", ".join(repr(choice) for choice in choices)
        hint = did_you_mean(str(value), map(str, choices))
        raise ConfigError(f"{field_name} is {value!r}{hint}; allowed: {allowed}")
    if item.type in (int, float) and isinstance(value, bool):
        raise ConfigError(f"{field_name} is {show_value(value)}; it must be a number")
    several = isinstance(value, tuple)
    low, high = item.metadata.get("minimum"), item.metadata.get("maximum")
    for place, number in enumerate(value if several else (value,)):
        if isinstance(number, bool) or not isinstance(number, int | float):
            continue
        name = f"{field_name}[{place}]" if several else field_name
        if not isfinite(number):
            raise ConfigError(f"{name} is {number}; it must be finite")
        if unit == " rad":  # no field's angle is more than a turn
            low, high = -TURN if low is None else low, TURN if high is None else high
        allowed = f"at least {low}" if low is not None and number < low else ""
        allowed = f"at most {high}" if high is not None and number > high else allowed
        if allowed:
            hint = _other_unit(number, low, high, unit.strip())
            raise ConfigError(f"{name} is {number}{unit}; it must be {allowed}{unit}{hint}")


def check_number(
    name: str, value: Any, low: float, high: float, unit: str = "", whole: bool = False
) -> float:
    """Return a number that a user's file gives, or raise `ConfigError`; `true` is none."""
    is_number = is_of(value, (int,) if whole else (int, float))
    if not (is_number and low <= value <= high):  # not NaN either
        hint = _other_unit(value, low, high, unit) if is_number else ""
        allowed = f"{'whole numbers, ' * whole}{low:g} to {high:g} {unit}".rstrip()
        allowed = "finite numbers" if high == LARGEST else allowed
        raise ConfigError(f"{name} is {shown(value)}; allowed: {allowed}{hint}")
    return float(value)


def check_numbers(
    name: str, values: Any, size: int | None, most: float = LARGEST, unit: str = ""
) -> list[float]:
    """Return a list of so many numbers, from `-most` to `most`; raises `ConfigError`."""
    if not isinstance(values, list) or size not in (None, len(values)):
        count = "" if size is None else f"{size} "
        raise ConfigError(f"{name} is {shown(values)}; it must be a list of {count}numbers")
    return [
        check_number(f"{name}[{place}]", value, -most, most, unit)
        for place, value in enumerate(values)
    ]


def check_text(name: str, value: Any, least: int = 1, most: int = LONGEST_NAME) -> str:
    """Return a text that a user's file gives; raises `ConfigError`: none, too short or too long."""
    if not isinstance(value, str) or not least <= len(value) <= most:
        raise ConfigError(
            f"{name} is {shown(value, most)}; it must be a text of {least} to {most} characters"
        )
    return value


def is_of(value: Any, kinds: tuple[type, ...]) -> bool:
    """Return whether a value is of one of these types; of Python's, `True` is no number."""
    return isinstance(value, kinds) and (bool in kinds or not isinstance(value, bool))


def check_angle(name: str, value: Any, turns: int = 1) -> float:
    """Return an angle [rad] that a user's file gives; beyond so many turns it is in degrees."""
    return check_number(name, value, -turns * TURN, turns * TURN, "rad")


def _other_unit(value: float, low: float | None, high: float | None, unit: str) -> str:
    """Return a hint where a number that is not allowed would be in the unit that is often meant."""
    other, factor = OTHER_UNITS.get(unit, ("", 0.0))
    here = value * factor
    if not here or not isfinite(here) or (low is not None and here < low):
        return ""
    return "" if high is not None and here > high else f": {value:g} {other} are {here:.4g} {unit}"


class FieldSetting(NamedTuple):
    """One field of settings or of settings nested in them."""

    name: str  # with those of the groups that it is in: ``planner.samples``
    item: "dataclasses.Field[Any]"
    kind: Any  # its type
    value: Any
    live: bool  # whether it, or a group that it is in, is declared so


def settings_of(settings: Config, prefix: str = "", live: bool = False) -> Iterator[FieldSetting]:
    """Yield every setting; nested ones by the names of their groups, too."""
    kinds = get_type_hints(type(settings))
    for item in dataclasses.fields(settings):
        name, value = prefix + item.name, getattr(settings, item.name)
        may_change = live or item.metadata.get("live", False)
        if isinstance(value, Config):
            yield from settings_of(value, f"{name}.", may_change)
        else:
            yield FieldSetting(name, item, kinds[item.name], value, may_change)


def with_settings(settings: C, values: Mapping[str, Any], prefix: str = "") -> C:
    """Return settings with other values of those that have a name there."""
    changes = {}
    for item in dataclasses.fields(settings):
        name, value = prefix + item.name, getattr(settings, item.name)
        if isinstance(value, Config):
            changes[item.name] = with_settings(value, values, f"{name}.")
        elif name in values:
            changes[item.name] = values[name]
    return dataclasses.replace(settings, **changes)


def typed_settings(kind: type["Config"], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings that come from JSON, lists as tuples and objects as nested settings."""
    right = get_type_hints(kind)
    return {name: typed(name, right.get(name, object), value) for name, value in settings.items()}


def typed(name: str, hint: Any, value: Any) -> Any:
    """Return a value of JSON or of a parameter in the type of its field; raises `TypeError`."""
    is_tuple = get_origin(hint) is tuple
    if is_tuple and isinstance(value, list | tuple | array):
        kinds = get_args(hint)
        if kinds[-1] is not Ellipsis and len(value) != len(kinds):
            raise TypeError(f"{name} has {len(value)} values; it must have {len(kinds)}")
        return tuple(typed(f"{name}[{place}]", kinds[0], one) for place, one in enumerate(value))
    if isinstance(value, dict) and isinstance(hint, type) and issubclass(hint, Config):
        return hint(**typed_settings(hint, value))
    kind = str if get_origin(hint) is Literal else tuple if is_tuple else hint
    if not is_of(value, (int, float) if kind is float else (kind,)):
        raise TypeError(f"{name} is {value!r}; it must be {TYPE_NAMES.get(kind, kind)}")
    return float(value) if kind is float else value  # NumPy takes no large integers
