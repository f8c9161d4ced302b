"""The physics engines of a world, by name. The module of one is loaded when a world is made."""

from collections.abc import Iterable
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Final, NamedTuple

from sain_core.errors import ConfigError


class EngineEntry(NamedTuple):
    """Where an engine is, and what it needs.

    Attributes:
        simulation: module and name of its `Simulation`.
        module: what has to be installed.
        install: how to get that.
        lacks: effects of a rough world that it cannot simulate.
    """

    simulation: str
    module: str
    install: str
    lacks: tuple[str, ...] = ()


BULLET: Final = "bullet"
MUJOCO: Final = "mujoco"
ENGINES: Final = {
    BULLET: EngineEntry(
        "sain_sim.bullet.cell:BulletSimulation",
        "pybullet",
        "./env pip install -r requirements/bullet.txt (above Python 3.11 it compiles for minutes)",
    ),
    MUJOCO: EngineEntry(
        "sain_sim.mujoco.cell:MujocoSimulation",
        "mujoco",
        'pip install "sain_sim[mujoco]", or pip install mujoco',
        ("direction", "tool", "torque"),
    ),
}
# PyBullet has no wheel above Python 3.11, where the set-up leaves it out.
DEFAULT_ENGINE: Final = BULLET if find_spec(ENGINES[BULLET].module) else MUJOCO


def is_installed(engine: str) -> bool:
    """Return whether the package of an engine is installed; the engine is not loaded."""
    return find_spec(ENGINES[engine].module) is not None


def needs(engine: str) -> str:
    """Return what an engine that is not installed needs, and how to get it."""
    entry = ENGINES[engine]
    return f"needs the package {entry.module}, which is not installed: {entry.install}"


def check_engine(engine: str, effects: Iterable[str] = ()) -> None:
    """Raise `ConfigError` when an engine is unknown or not installed, or lacks one of the effects.

    The engine itself is not loaded.
    """
    if engine not in ENGINES:
        raise ConfigError(f"engine is {engine!r}; allowed: {', '.join(ENGINES)}")
    entry = ENGINES[engine]
    if not is_installed(engine):
        raise ConfigError(f"engine {engine} {needs(engine)}")
    if lacking := [effect for effect in effects if effect in entry.lacks]:
        raise ConfigError(
            f"engine {engine} cannot simulate {', '.join(lacking)}; use engine {BULLET}, or effects"
            f" without {', '.join(entry.lacks)}"
        )


def simulation_class(engine: str) -> Any:
    """Load and return an engine's `Simulation`; see `check_engine` for errors."""
    check_engine(engine)
    module, _, name = ENGINES[engine].simulation.partition(":")
    return getattr(import_module(module), name)
