"""What is believed of a laboratory before an episode's first push."""

from dataclasses import dataclass, field, replace
from typing import Any, Final, Self

import numpy as np

from sain_model.identification.curves import PushCurves
from sain_model.identification.parameters import COUNT
from sain_model.identification.structures import Structure
from sain_model.physics.friction import FrictionConfig
from sain_model.physics.planar_config import TEXTBOOK, PlanarConfig

SOLVER_AXES: Final = "solver axes"
FITTED: Final = "fitted"
NO_AXES: Final = "textbook"
TRAINED: Final = 3.0  # logarithm of the odds that the physics is of the kind that is trained on
KEEP: Final = 0.5  # logarithm of the odds that a network's correction holds, beforehand


@dataclass(frozen=True, eq=False)
class Belief:
    """Kinds of physics, and whether a network's correction holds.

    Attributes:
        structures: kinds of physics; that with the network is the first.
        network_log_odds: logarithm of the odds that the network's correction holds.
        card: where this comes from; empty: no laboratory was recorded.
        curves: of the latest pushes.
    """

    structures: tuple[Structure, ...]
    network_log_odds: float = KEEP
    card: dict[str, Any] = field(default_factory=dict)
    curves: PushCurves = field(default_factory=PushCurves)

    @property
    def mass_log_std(self) -> float:
        """Standard deviation of the logarithm of the ratio of masses; 0: they are measured."""
        return self.likeliest.mass_log_std

    def with_unknown_masses(self) -> Self:
        """Return this belief where masses are not measured."""
        structures = tuple(structure.with_unknown_masses() for structure in self.structures)
        return replace(self, structures=structures, curves=PushCurves())

    @property
    def likeliest(self) -> Structure:
        """The most likely structure, the first of equals."""
        return max(self.structures, key=lambda structure: structure.log_odds)


def usual_belief(config: PlanarConfig, friction: FrictionConfig) -> Belief:
    """Return what is believed without recordings: a network's own prior, or the textbook's.

    Args:
        config: of the prior that the network corrects.
        friction: how that prior infers friction.
    """
    wide = np.eye(COUNT)
    name = SOLVER_AXES if config.has_axes else FITTED
    first = Structure(name, config, wide, friction, TRAINED, corrected=True)
    textbook = replace(TEXTBOOK, friction=config.friction)
    return Belief((first, Structure(NO_AXES, textbook, wide, FrictionConfig())))
