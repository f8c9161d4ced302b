"""The physics engines of a world, by name: ours, and the worlds that installed packages offer.

The module of an engine is loaded when a world is made.
"""

from collections.abc import Iterable
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Final, NamedTuple

from sain_core.errors import ConfigError
from sain_core.guarding.plugins import Plugins
from sain_core.world import AnyWorld, Setting


class EngineEntry(NamedTuple):
    """Where an engine is, and what it needs.

    Attributes:
        simulation: module and name of its `Simulation`.
        module: what has to be installed.
        install: how to get that.
    """

    simulation: str
    module: str
    install: str


BULLET: Final = "bullet"
MUJOCO: Final = "mujoco"
ENGINES: Final = {
    BULLET: EngineEntry(
        "sain_sim.engines.bullet_cell:BulletSimulation",
        "pybullet",
        "pip install pybullet==3.2.7 (above Python 3.11 it compiles for ten minutes)",
    ),
    MUJOCO: EngineEntry(
        "sain_sim.engines.mujoco_cell:MujocoSimulation",
        "mujoco",
        "pip install mujoco",
    ),
}
# PyBullet has no wheel above Python 3.11, where the set-up leaves it out.
DEFAULT_ENGINE: Final = BULLET if find_spec(ENGINES[BULLET].module) else MUJOCO
DEFAULT_ROBOT: Final = "paper_panda"

ENGINE_HELP: Final = f"physics engine: {', '.join(ENGINES)}, or a world of an installed package"
OFFERED: Final = Plugins("sain.worlds", "engine", ENGINES)


def is_installed(engine: str) -> bool:
    """Return whether the package of a built-in engine is installed; the engine is not loaded."""
    return find_spec(ENGINES[engine].module) is not None


def needs(engine: str) -> str:
    """Return what a built-in engine that is not installed needs, and how to get it."""
    entry = ENGINES[engine]
    return f"needs the package {entry.module}, which is not installed: {entry.install}"


def check_engine(engine: str) -> None:
    """Raise `ConfigError` when an engine is unknown or not installed. It is not loaded."""
    OFFERED.check(engine)
    if engine in ENGINES and not is_installed(engine):
        raise ConfigError(f"engine {engine} {needs(engine)}")


def modules_of(engines: Iterable[str]) -> list[str]:
    """Return the distributions whose versions decide about what engines simulate."""
    names = set()
    for engine in engines:
        if engine in ENGINES:
            names.add(ENGINES[engine].module)
        elif (dist := OFFERED.find(engine).dist) is not None:
            names.add(dist.name)
    return sorted(names)


def simulation_class(engine: str) -> Any:
    """Load and return a built-in engine's `Simulation`; see `check_engine` for errors."""
    check_engine(engine)
    if engine not in ENGINES:
        raise ConfigError(f"engine {engine!r} is no engine of ours: {', '.join(ENGINES)}")
    module, _, name = ENGINES[engine].simulation.partition(":")
    return getattr(import_module(module), name)


def load_world(engine: str) -> AnyWorld[Setting]:
    """Return the world that an installed package offers by this name.

    Raises:
        ConfigError: no package offers it, two do, its package fails, or it is no world.
    """
    entry = OFFERED.find(engine)
    loaded = OFFERED.load(entry, lambda load: load(engine))
    if not isinstance(loaded, AnyWorld):
        problem = f"{entry.value} returned a {type(loaded).__name__}"
        raise OFFERED.wrong(
            entry, f"{problem}; it must return a world, with the methods reset, observe and push"
        )
    return loaded
