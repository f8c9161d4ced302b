"""Dynamics by name: what command lines, parameters and nodes say when they mean a model."""

from sain_core.dynamics import Dynamics, IdentityPrior
from sain_model.planar import PlanarPrior


def load_dynamics(name: str) -> Dynamics:
    """Return the dynamics of this name."""
    return IdentityPrior() if name == "identity" else PlanarPrior()
