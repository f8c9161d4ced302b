"""Kinds of physics, each with what is believed of its parameters."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_model.identification.parameters import MASS_RATIO, RATIO, parameters_of
from sain_model.physics.friction import FrictionConfig
from sain_model.physics.parameters import Parameter
from sain_model.physics.planar_config import PlanarConfig


@dataclass(frozen=True, eq=False)
class Structure:
    """A kind of physics, and its most likely parameters.

    Attributes:
        name: for people.
        config: the most likely parameters.
        covariance: of the parameters' vector z, (D, D). D states whether masses are measured.
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

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The D parameters that pushes tell."""
        return parameters_of(self.config)[: len(self.covariance)]

    @property
    def mass_log_std(self) -> float:
        """Standard deviation of the logarithm of the ratio of masses; 0: they are measured."""
        if len(self.covariance) <= MASS_RATIO:
            return 0.0
        return RATIO.spread * float(np.sqrt(self.covariance[MASS_RATIO, MASS_RATIO]))

    def with_unknown_masses(self) -> Self:
        """Return this kind of physics with the ratio of masses as one more parameter."""
        if len(self.covariance) > MASS_RATIO:
            return self
        covariance = np.eye(MASS_RATIO + 1)
        covariance[:MASS_RATIO, :MASS_RATIO] = self.covariance
        return replace(self, covariance=covariance)

    @cached_property
    def precision(self) -> Float[ndarray, "D D"]:
        """The inverse of the covariance."""
        return np.linalg.inv(self.covariance)
