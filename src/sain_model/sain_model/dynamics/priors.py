"""The physics below a network, by name; importable without PyTorch."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from typing import Any, TypeVar, get_type_hints

from sain_core.config import Config
from sain_core.dynamics import Dynamics, IdentityPrior
from sain_core.errors import CheckpointError
from sain_model.dynamics.settings import (
    IDENTITY,
    PLANAR,
    PLANAR_AXES,
    PRIORS,
)
from sain_model.physics.planar import PlanarConfig, PlanarPrior
from sain_model.physics.planar_axes import AXES

C = TypeVar("C", bound=Config)
Settings = dict[str, Any]


def load_prior(name: str, settings: Settings | None = None) -> Dynamics:
    """Return a prior by its name, with its usual settings or with these.

    Raises:
        CheckpointError: there is none of that name, or it has no such settings.
    """
    if name == IDENTITY:
        return IdentityPrior()
    if name not in PRIORS:
        raise CheckpointError(f"no prior {name!r}; known: {', '.join(PRIORS)}")
    return load_told_prior(name, settings)


def load_told_prior(name: str, settings: Settings | None = None) -> PlanarPrior:
    """Return a prior that can be told what is unlike the textbook.

    Raises:
        CheckpointError: there is none of that name, or it has no such settings.
    """
    if name not in (PLANAR, PLANAR_AXES):
        raise CheckpointError(f"the prior {name!r} cannot be told; {PLANAR} and {PLANAR_AXES} can")
    usual = PlanarConfig() if name == PLANAR else AXES
    with naming("settings of the planar prior"):
        return PlanarPrior(replace(usual, **typed(PlanarConfig, settings or {})))


def prior_settings(prior: Dynamics) -> Settings:
    """Return the settings that make a prior again: the second argument of `load_prior`."""
    return asdict(prior.config) if isinstance(prior, PlanarPrior) else {}


@contextmanager
def naming(part: str) -> Iterator[None]:
    """Turn what goes wrong with a part of a card into an error that names the part.

    Raises:
        CheckpointError: anything went wrong.
    """
    try:
        yield
    except (CheckpointError, TypeError, KeyError, ValueError) as error:  # ConfigError is one
        raise CheckpointError(f"{part}: {error}") from error


def typed(kind: type[Config], settings: Settings) -> Settings:
    """Return settings that come from outside when their values are of the right types.

    Raises:
        TypeError: naming the one that is not.
    """
    right = get_type_hints(kind)
    for name, value in dict(settings).items():
        allowed = (int, float) if right.get(name) is float else (right.get(name, object),)
        if not isinstance(value, allowed) or (isinstance(value, bool) and bool not in allowed):
            raise TypeError(f"{name} is {value!r}; it must be of type {allowed[-1].__name__}")
    return settings
