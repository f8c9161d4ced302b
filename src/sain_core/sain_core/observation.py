"""How exactly bodies are observed: what a camera does, and what the planner expects of it."""

from dataclasses import dataclass, fields
from math import isfinite
from typing import Any, Final

from sain_core.config import Config, option
from sain_core.errors import ConfigError

MOST_NOISE: Final = (0.02, 0.35)  # [m], a third of the smallest disk's radius; [rad], 20 degrees
UNITS: Final = ("m", "rad")
MASSES: Final = "mass"
RADII: Final = "radius"
UNKNOWNS: Final = (MASSES, RADII)


@dataclass(frozen=True)
class ObservationConfig(Config):
    """Errors of observed poses. The defaults are exact and immediate observations."""

    noise: str = option(
        "0,0",
        "standard deviation of observed positions [m] and headings [rad], drawn anew for each"
        " frame: METRES,RADIANS",
    )
    bias: str = option("0,0", "as noise, but drawn once for each body and episode: METRES,RADIANS")
    delay: float = option(
        0.0, "time from the observation of a frame to its arrival", unit="s", minimum=0, maximum=0.5
    )
    unknown: str = option(
        "",
        "quantities that are observed as nominal, separated by commas: mass, radius (of disks)",
    )

    def __post_init__(self) -> None:
        """Check the fields, the numbers in words, and the names of what is unknown."""
        super().__post_init__()
        for name in ("noise", "bias"):
            self._pair(name)
        unknown_names(self.unknown)

    @property
    def noise_std(self) -> tuple[float, float]:
        """The noise of a frame, [m] and [rad]."""
        return self._pair("noise")

    @property
    def bias_std(self) -> tuple[float, float]:
        """The bias of an episode, [m] and [rad]."""
        return self._pair("bias")

    @property
    def unknown_names(self) -> tuple[str, ...]:
        """What is not measured."""
        return unknown_names(self.unknown)

    @property
    def is_exact(self) -> bool:
        """Whether what is observed is the truth, at once."""
        return not (any(self.noise_std) or any(self.bias_std) or self.delay or self.unknown_names)

    def _pair(self, name: str) -> tuple[float, float]:
        text = getattr(self, name)
        try:
            place, turn = (float(word) for word in text.split(","))
        except ValueError as error:
            raise ConfigError(
                f"{name} is {text!r}; allowed: two numbers with a comma, METRES,RADIANS, for"
                " example 0.005,0.035"
            ) from error
        for value, most, unit in zip((place, turn), MOST_NOISE, UNITS, strict=True):
            if not (isfinite(value) and 0.0 <= value <= most):
                raise ConfigError(
                    f"{name} has a standard deviation of {value:g} {unit}; allowed: 0 to"
                    f" {most:g} {unit}, with which a body is still where it is seen"
                )
        return place, turn


def unknown_names(text: str) -> tuple[str, ...]:
    """Return what is not measured, by a text of names with commas.

    Raises:
        ConfigError: another name than `UNKNOWNS`.
    """
    names = tuple(dict.fromkeys(word.strip() for word in text.split(",") if word))
    if any(name not in UNKNOWNS for name in names):
        raise ConfigError(f"unknown is {text!r}; allowed: {', '.join(UNKNOWNS)}")
    return names


def observation_settings(config: ObservationConfig) -> dict[str, Any]:
    """Return what a planner is given of a camera, by the names of `ObservationConfig`."""
    return {item.name: getattr(config, item.name) for item in fields(ObservationConfig)}


def changed_settings(config: ObservationConfig) -> dict[str, Any]:
    """Return those of `observation_settings` that are not as in exact observations."""
    exact = observation_settings(ObservationConfig())
    own = observation_settings(config)
    return {name: value for name, value in own.items() if value != exact[name]}
