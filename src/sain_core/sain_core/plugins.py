"""The one registry of models: dynamics by name, from every installed package.

A package offers dynamics through entry points in the group ``sain.dynamics``::

    entry_points={"sain.dynamics": ["my_model = my_model:load"]}

Each is a function from the name that was asked for to a model. A name that no package offers
is taken as the path of a checkpoint, and goes to the entry point called ``checkpoint``. Every
command and node finds its models here; docs/guides/your_model.md states what a model must do.
"""

from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Final

from sain_core.errors import ConfigError
from sain_core.extensions.offers import Offers
from sain_core.model import Model, as_model
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


def load_dynamics(name_or_path: str) -> Model:
    """Return the model of this name, or the one in this checkpoint.

    Raises:
        ConfigError: neither a known name nor a path; two packages offer the name; its package
            fails; or what it offers is no model. The message names the package.
        CheckpointError: a checkpoint that is missing, damaged or of another architecture.
    """
    entry = _find(name_or_path)
    loaded = MODELS.load(entry, lambda load: load(name_or_path), name_or_path)
    try:
        return as_model(loaded)
    except ConfigError as error:
        raise MODELS.wrong(entry, f"{entry.value} returned {error}", name_or_path) from error


def as_observed(model: Model, unknown: str) -> Model:
    """Return a model for scenes in which these names, with commas, are nominal.

    Raises:
        ConfigError: see `unknown_names`.
    """
    return model.with_unknown_masses() if MASSES in unknown_names(unknown) else model


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
