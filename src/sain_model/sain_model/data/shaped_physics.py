"""Filters of friction for the bodies of a data set."""

from dataclasses import replace

from sain_core.shapes.bodies import Bodies
from sain_core.types import Scalars
from sain_model.data.dataset import Part
from sain_model.physics.friction import FrictionFilter
from sain_model.physics.planar import PlanarPrior


def filter_for(friction: FrictionFilter, bodies: Bodies) -> FrictionFilter:
    """Return a filter whose physics predicts these bodies."""
    if not isinstance(friction.physics, PlanarPrior):
        return friction
    return replace(friction, physics=friction.physics.with_bodies(bodies))


def others_friction(data: Part, friction: FrictionFilter | None) -> Scalars | None:
    """Return the friction (M,) that all other pushes of an episode tell of; None: the nominal."""
    if friction is None:
        return None
    told = filter_for(friction, data.bodies)
    likelihood = told.log_likelihood(data.state, data.action, data.next_state)
    return told.others(likelihood, data.episode).mean
