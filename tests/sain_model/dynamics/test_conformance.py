"""Every model of this package keeps the contract that a model of another package must keep."""

from dataclasses import replace

import pytest
import torch

from sain_core.conformance import check_dynamics
from sain_core.model import IdentityPrior, Model, load_dynamics
from sain_model.dynamics.sain import residual_model
from sain_model.inference.kinds import friction_kind
from sain_model.network.interaction_network import new_network
from sain_model.network.settings import IDENTITY, NetworkConfig
from sain_model.physics.planar import PlanarPrior


def network(**settings: object) -> torch.nn.Module:
    """A network that moves disks by millimetres."""
    made = new_network(replace(NetworkConfig(hidden=8, message=4), **settings), 0)
    torch.manual_seed(1)
    with torch.no_grad():
        for parameter in made.parameters():
            parameter.add_(0.1 * torch.randn_like(parameter))
    return made


MODELS: dict[str, Model] = {
    "learned": residual_model(
        network().weights, friction_kind(IdentityPrior(), infers=False), IDENTITY
    ),
    "residual": residual_model(network().weights, friction_kind(PlanarPrior()), "planar"),
    "ensemble in the world": residual_model(
        network(members=3, features="world").weights,
        friction_kind(PlanarPrior(), infers=False),
        "planar",
    ),
    "recurrent": residual_model(
        network().weights, friction_kind(PlanarPrior(), infers=False), "planar", recurrent=True
    ),
}


@pytest.mark.parametrize("name", ["planar", "planar_axes", "identity", "sain"])
def test_every_model_that_is_offered_keeps_the_contract(name):
    check_dynamics(load_dynamics(name), disks=(2, 3, 5))


@pytest.mark.parametrize("name", MODELS)
def test_every_kind_of_network_keeps_the_contract(name):
    check_dynamics(MODELS[name])
