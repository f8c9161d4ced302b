"""Faults of the bench, as one text: ``delay=0.1,abort=0.5,every=2``, or ``none``."""

import dataclasses
from dataclasses import dataclass
from typing import Final

from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.guarding.plugins import did_you_mean

NONE: Final = "none"
FROZEN: Final = 3.0  # [s] for which joint states stay the same


@dataclass(frozen=True)
class Faults(Config):
    """What goes wrong; of 0 and false, nothing."""

    delay: float = option(
        0.0, "a goal begins so long after it was accepted", unit="s", minimum=0.0, maximum=2.0
    )
    abort: float = option(
        0.0, "of every N-th goal: time into it at which it is aborted", unit="s", minimum=0.0
    )
    freeze: float = option(
        0.0,
        f"of every N-th goal: time into it at which joint states freeze for {FROZEN:g} s",
        unit="s",
        minimum=0.0,
    )
    dark: float = option(
        0.0,
        "of every N-th goal: for how long nothing is seen from its start on",
        unit="s",
        minimum=0.0,
        maximum=60.0,
    )
    reject: bool = option(False, "every N-th goal is rejected")
    twice: bool = option(False, "each goal is answered twice, first at once: a lie")
    every: int = option(4, "N: goals are approaches, strokes and retreats", minimum=1)


FIELDS: Final = {one.name: one for one in dataclasses.fields(Faults)}
FAULTS_HELP: Final = "delay=S, abort=S, freeze=S, dark=S, reject, twice, every=N"


def parse_faults(text: str) -> Faults:
    """Return the faults that a text names.

    Raises:
        ConfigError: naming the word that is wrong, and what is allowed.
    """
    given: dict[str, float | bool] = {}
    for word in [word.strip() for word in text.split(",") if word.strip() and text != NONE]:
        name, has_value, value = word.partition("=")
        if name not in FIELDS:
            hint = did_you_mean(name, FIELDS)
            names = ", ".join((NONE, *FIELDS))
            raise ConfigError(f"faults has {name!r}{hint}; allowed: {names}, with commas between")
        given[name] = _value(name, bool(has_value), value)
    return Faults(**given)  # type: ignore[arg-type]


def _value(name: str, has_value: bool, text: str) -> float | bool:
    """Return the value of a fault, or raise `ConfigError`."""
    kind, example = FIELDS[name].type, FIELDS[name].default or 0.5
    if kind is bool and not has_value:
        return True
    try:
        if kind is not bool:
            return int(text) if kind is int else float(text)
    except ValueError:
        pass
    right = name if kind is bool else f"{name}={example}"
    given = f"{name}={text}" if has_value else name
    raise ConfigError(f"faults has {given!r}; it must be as in {right}")
