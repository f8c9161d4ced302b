"""Dynamics by name: how a node gets a model without its package knowing the model's.

A package offers dynamics through entry points in the group ``sain.dynamics``::

    entry_points={"sain.dynamics": ["planar = sain_model.dynamics.load:load_dynamics"]}

Each is a function from the name that was asked for to a `Dynamics`. What is no such name is
taken as the path of a checkpoint, and goes to the entry point called ``checkpoint``.
"""

from difflib import get_close_matches
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

from sain_core.dynamics import Dynamics
from sain_core.errors import ConfigError

GROUP = "sain.dynamics"
CHECKPOINT = "checkpoint"


def dynamics_names() -> list[str]:
    """Return the names of all dynamics that installed packages offer."""
    return sorted(name for name in _offered() if name != CHECKPOINT)


def load_dynamics(name_or_path: str) -> Dynamics:
    """Return the dynamics of this name, or the one in this checkpoint.

    Raises:
        ConfigError: neither a known name nor a path.
        CheckpointError: a checkpoint that is missing, damaged or of another architecture.
    """
    offered = _offered()
    if name_or_path != CHECKPOINT and name_or_path in offered:
        return _load(offered[name_or_path], name_or_path)
    if CHECKPOINT in offered and _looks_like_path(name_or_path):
        return _load(offered[CHECKPOINT], name_or_path)
    names = dynamics_names()
    near = get_close_matches(name_or_path, names, n=1)
    hint = f" (did you mean {near[0]!r}?)" if near else ""
    known = ", ".join(names) or f"none: no installed package has the entry points {GROUP!r}"
    raise ConfigError(
        f"model {name_or_path!r} is unknown{hint}; known: {known}, or the path of a checkpoint"
    )


def _offered() -> dict[str, EntryPoint]:
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def _load(entry: EntryPoint, name: str) -> Dynamics:
    loaded = entry.load()(name)
    if not isinstance(loaded, Dynamics):
        what = type(loaded).__name__
        raise ConfigError(f"entry point {entry.value!r} gave a {what}; it must give a Dynamics")
    return loaded


def _looks_like_path(text: str) -> bool:
    return "/" in text or text.startswith("~") or bool(Path(text).suffix) or Path(text).exists()
