"""The one registry of models: dynamics by name, from every installed package.

A package offers dynamics through entry points in the group ``sain.dynamics``::

    entry_points={"sain.dynamics": ["my_model = my_model:load"]}

Each is a function from the name that was asked for to a `Dynamics`. A name that no package offers
is taken as the path of a checkpoint, and goes to the entry point called ``checkpoint``. Every
command and node finds its models here; docs/guides/your_model.md states what a model must do.
"""

from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Final, Protocol, runtime_checkable

from sain_core.dynamics import Dynamics
from sain_core.errors import ConfigError
from sain_core.extensions.offers import Offers
from sain_core.observation import MASSES, unknown_names

GROUP: Final = "sain.dynamics"
CHECKPOINT: Final = "checkpoint"
MODELS: Final = Offers(GROUP, "model", hidden=CHECKPOINT, more=", or the path of a checkpoint")


def dynamics_names() -> list[str]:
    """Return the names of all dynamics that installed packages offer."""
    return MODELS.names()


def check_model_name(name_or_path: str) -> None:
    """Check that a model has this name, or that it can be a checkpoint; nothing is imported.

    Raises:
        ConfigError: no installed package offers it, or two do.
    """
    _find(name_or_path)


@runtime_checkable
class BelievingDynamics(Protocol):
    """A `Dynamics` that can begin each episode with what a laboratory's recordings told."""

    def believing(self, path: Path) -> Dynamics:
        """Return the dynamics with the belief in this file. Pure: `self` stays as it is.

        Raises:
            CheckpointError: no such file, or not a belief.
            ConfigError: a belief for another kind of model.
        """
        ...


def load_dynamics(name_or_path: str) -> Dynamics:
    """Return the dynamics of this name, or the one in this checkpoint.

    Raises:
        ConfigError: neither a known name nor a path; two packages offer the name; or its package
            fails. The message names the package.
        CheckpointError: a checkpoint that is missing, damaged or of another architecture.
    """
    entry = _find(name_or_path)
    loaded = MODELS.load(entry, lambda load: load(name_or_path), name_or_path)
    if not isinstance(loaded, Dynamics):
        problem = f"{entry.value} returned a {type(loaded).__name__}"
        raise MODELS.wrong(
            entry, f"{problem}; it must return a Dynamics, which has the method step", name_or_path
        )
    return loaded


def with_belief(name: str, dynamics: Dynamics, belief: str) -> Dynamics:
    """Return a dynamics of this name with the belief at a path; as it is where there is no path.

    Raises:
        ConfigError: it takes no belief, or none like this.
        CheckpointError: no such file, or not a belief.
    """
    if not belief:
        return dynamics
    if not isinstance(dynamics, BelievingDynamics):
        raise ConfigError(
            f"model {name!r} takes no belief; 'sain' does, and checkpoints on planar priors"
        )
    return dynamics.believing(Path(belief).expanduser())


@runtime_checkable
class WeighingDynamics(Protocol):
    """A `Dynamics` that can infer masses which scenes state as nominal."""

    def with_unknown_masses(self) -> Dynamics:
        """Return the dynamics that infers the masses. Pure: `self` stays as it is."""
        ...


def as_observed(dynamics: Dynamics, unknown: str) -> Dynamics:
    """Return a dynamics for scenes in which these names, with commas, are nominal.

    It is the dynamics itself where masses are measured, and if it cannot infer them.

    Raises:
        ConfigError: see `unknown_names`.
    """
    if MASSES in unknown_names(unknown) and isinstance(dynamics, WeighingDynamics):
        return dynamics.with_unknown_masses()
    return dynamics


def _find(name_or_path: str) -> EntryPoint:
    """Return the only entry point that offers a name, or else that of checkpoints."""
    offered = MODELS.entries()
    entries = offered.get(name_or_path, []) if name_or_path != CHECKPOINT else []
    if not entries and _looks_like_path(name_or_path):
        entries = offered.get(CHECKPOINT, [])
    if not entries:
        raise MODELS.unknown(name_or_path)
    return MODELS.only(name_or_path, entries)


def _looks_like_path(text: str) -> bool:
    return "/" in text or text.startswith("~") or bool(Path(text).suffix) or Path(text).exists()
