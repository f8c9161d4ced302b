"""Every model of this package keeps the contract that a model of another package must keep."""

import pytest

from sain_core.conformance import check_dynamics
from sain_core.model import IdentityPrior, Model, load_dynamics
from sain_model.dynamics.sain import residual_model
from sain_model.inference.kinds import friction_kind
from sain_model.network.settings import IDENTITY
from sain_model.physics.planar import PlanarPrior
from tests.sain_model.conftest import random_network

WEIGHTS = random_network(0.1, 1, hidden=8, message=4).weights
GIVEN = friction_kind(PlanarPrior(), infers=False)
MODELS: dict[str, Model] = {
    "learned": residual_model(WEIGHTS, friction_kind(IdentityPrior(), infers=False), IDENTITY),
    "residual": residual_model(WEIGHTS, friction_kind(PlanarPrior()), "planar"),
    "ensemble in the world": residual_model(
        random_network(0.1, hidden=8, members=3, features="world").weights, GIVEN, "planar"
    ),
    "recurrent": residual_model(WEIGHTS, GIVEN, "planar", recurrent=True),
}


@pytest.mark.parametrize("name", ["planar", "planar_axes", "identity", "sain"])
def test_every_model_that_is_offered_keeps_the_contract(name):
    check_dynamics(load_dynamics(name), disks=(2, 3, 5))


@pytest.mark.parametrize("name", MODELS)
def test_every_kind_of_network_keeps_the_contract(name):
    check_dynamics(MODELS[name])
