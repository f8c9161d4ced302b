from dataclasses import dataclass

import pytest

from sain_core.config import Config, option
from sain_core.errors import ConfigError


@dataclass(frozen=True)
class Tool(Config):
    radius: float = option(0.012, "radius", unit="m", minimum=0.001, maximum=0.05)
    shape: str = option("stick", "shape", choices=("stick", "ball"))
    lengths: tuple[float, ...] = option((0.1, 0.2), "lengths", unit="m", minimum=0.0)


def test_defaults_stand_in_one_place() -> None:
    assert Tool() == Tool(0.012, "stick", (0.1, 0.2))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"radius": 0.1}, r"Tool.radius is 0.1 m; it must be at most 0.05 m"),
        ({"radius": 0.0}, r"Tool.radius is 0.0 m; it must be at least 0.001 m"),
        ({"radius": float("nan")}, "Tool.radius is nan; it must be finite"),
        ({"shape": "cone"}, "Tool.shape is 'cone'; allowed: 'stick', 'ball'"),
        ({"lengths": (0.1, -0.2)}, r"Tool.lengths\[1\] is -0.2 m; it must be at least 0.0 m"),
    ],
)
def test_a_value_that_is_not_allowed_is_named(values: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Tool(**values)  # type: ignore[arg-type]
