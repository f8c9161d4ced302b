from dataclasses import dataclass

import pytest

from sain_core.config import (
    Config,
    check_angle,
    check_number,
    check_numbers,
    option,
    typed_settings,
)
from sain_core.errors import ConfigError


@dataclass(frozen=True)
class Tool(Config):
    radius: float = option(0.012, "radius", unit="m", minimum=0.001, maximum=0.05)
    shape: str = option("stick", "shape", choices=("stick", "ball"))
    angle: float = option(0.0, "angle", unit="rad")
    lengths: tuple[float, ...] = option((0.1, 0.2), "lengths", unit="m", minimum=0.0)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"radius": 0.1}, r"Tool.radius is 0.1 m; it must be at most 0.05 m"),
        ({"radius": 0.0}, r"Tool.radius is 0.0 m; it must be at least 0.001 m"),
        ({"radius": float("nan")}, "Tool.radius is nan; it must be finite"),
        ({"radius": True}, "Tool.radius is true; it must be a number"),
        ({"shape": "cone"}, "Tool.shape is 'cone'; allowed: 'stick', 'ball'"),
        ({"radius": 12.0}, r"at most 0.05 m: 12 millimetres are 0.012 m"),
        ({"angle": 90.0}, r"Tool.angle is 90.0 rad; .*: 90 degrees are 1.571 rad"),
        ({"lengths": (0.1, -0.2)}, r"Tool.lengths\[1\] is -0.2 m; it must be at least 0.0 m"),
    ],
)
def test_a_value_that_is_not_allowed_is_named(values, message):
    with pytest.raises(ConfigError, match=message):
        Tool(**values)  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [True, None, "0.1", float("nan"), [0.1]])
def test_what_is_no_number_is_refused_with_what_is_allowed(value):
    with pytest.raises(ConfigError, match=r"mass is .*; allowed: 0 to 100 kg"):
        check_number("mass", value, 0.0, 100.0, "kg")
    with pytest.raises((TypeError, ConfigError), match=r"lengths\[1\] is .*; it must be"):
        Tool(**typed_settings(Tool, {"lengths": [0.1, value]}))


@pytest.mark.parametrize(
    ("check", "message"),
    [
        (lambda: check_angle("angle", 45), r"angle is 45; .*: 45 degrees are 0.7854 rad"),
        (lambda: check_number("n", 3.0, 1, 9, whole=True), "3.0; allowed: whole numbers, 1 to 9"),
        (lambda: check_numbers("a", [1, True], 2, 2.0, "m"), r"a\[1\] is True; allowed: -2 to 2 m"),
        (lambda: check_numbers("a", [1, 3], 2, 2.0, "m"), "2 m: 3 millimetres are 0.003 m"),
        (lambda: check_numbers("a", [1, float("inf")], 2, 2.0, "m"), r"a\[1\] is inf; allowed"),
        (lambda: check_numbers("a", [1, 10**99], 2, 2.0, "m"), r"a\[1\] is 1000.*; allowed: -2 to"),
        (lambda: check_numbers("a", [1], 2), r"a is \[1\]; it must be a list of 2 numbers"),
        (lambda: check_numbers("a", {"a": 1}, 2), "a is {'a': 1}; it must be a list of 2 numbers"),
    ],
)
def test_a_value_of_a_file_that_is_not_allowed_is_named(check, message):
    with pytest.raises(ConfigError, match=message):
        check()
