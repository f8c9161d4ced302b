"""Kinds of physics, each with what is believed of its parameters."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_model.physics.friction import FrictionConfig
from sain_model.physics.planar_config import PlanarConfig


@dataclass(frozen=True, eq=False)
class Structure:
    """A kind of physics, and its most likely parameters.

    Attributes:
        name: for people.
        config: the most likely parameters.
        covariance: of the parameters' vector z, (D, D).
        friction: how the friction of an episode is inferred.
        log_odds: logarithm of how likely this kind is, up to a constant.
        corrected: whether the network was trained on this kind.
    """

    name: str
    config: PlanarConfig
    covariance: Float[ndarray, "D D"]
    friction: FrictionConfig
    log_odds: float = 0.0
    corrected: bool = False

    @cached_property
    def precision(self) -> Float[ndarray, "D D"]:
        """The inverse of the covariance."""
        return np.linalg.inv(self.covariance)
