"""Priors by name, importable without PyTorch."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from typing import Any, TypeVar

from sain_core.config import Config, typed_settings
from sain_core.errors import CheckpointError
from sain_core.model import IdentityPrior, Model, load_dynamics
from sain_model.dynamics.sain import PHYSICS, Origin, SainDynamics
from sain_model.inference.kinds import friction_belief
from sain_model.network.settings import IDENTITY, PLANAR, PLANAR_PRIORS
from sain_model.physics.parameters import AXES
from sain_model.physics.planar import PlanarConfig, PlanarPrior

# What damaged values raise; a `ConfigError` is a `ValueError`.
DAMAGED = CheckpointError, TypeError, KeyError, ValueError, AttributeError, OverflowError
C = TypeVar("C", bound=Config)
Settings = dict[str, Any]


def load_prior(name: str) -> Model:
    """Return a prior as a model by itself: the planar ones infer friction from earlier pushes."""
    return load_planar(name) if name in PLANAR_PRIORS else make_prior(name)


def load_planar(name: str = PLANAR) -> SainDynamics:
    """Return planar physics that infers friction: what all models are compared with."""
    return SainDynamics(friction_belief(make_prior(name)), origin=Origin(PHYSICS, name))


def make_prior(name: str, settings: Settings | None = None) -> Model:
    """Return the bare prior of a name, from any installed package.

    `settings` are of `PlanarConfig`, for ``planar`` and ``planar_axes``; None: the usual ones.
    Raises `ConfigError`: no package offers this name; `CheckpointError`: it has no such settings.
    """
    if name == IDENTITY:
        return IdentityPrior()
    if name in PLANAR_PRIORS:
        usual = PlanarConfig() if name == PLANAR else AXES
        with naming("settings of the planar prior"):
            return PlanarPrior(replace(usual, **typed_settings(PlanarConfig, settings or {})))
    if settings:
        raise CheckpointError(f"the prior {name!r} has no settings; given: {', '.join(settings)}")
    return load_dynamics(name)


def prior_settings(prior: Model) -> Settings:
    """Return the settings that make a prior again: the second argument of `make_prior`."""
    return asdict(prior.config) if isinstance(prior, PlanarPrior) else {}


@contextmanager
def naming(part: str) -> Iterator[None]:
    """Turn what goes wrong with a part of a card into a `CheckpointError` that names it."""
    try:
        yield
    except DAMAGED as error:
        raise CheckpointError(f"{part}: {error}") from error
