"""Whether recordings can be from one laboratory: what each tells of the physics has to agree.

The kind of physics and the frictions are compared. Other parameters make up for each other, and
another choice of bodies or pushes moves them.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Final

import numpy as np

from sain_core.errors import DatasetError
from sain_model.identification.laboratory import LaboratoryFit
from sain_model.identification.parameters import (
    FRICTION,
    parameters_of,
    values_at,
)

FRICTIONS: Final = 3  # the first parameters
SURE_OF_KIND: Final = 20.0  # logarithm of the evidence
SURE: Final = 5.0  # standard deviations of a difference that is no chance
LARGE: Final = 0.3  # [spreads], smaller differences of parameters do not matter
LARGE_FRICTION: Final = 0.1  # [spreads], of a friction that all episodes of a recording share
SHARED: Final = 0.1  # [spreads], less scatter over episodes means that they share the friction


def check_kinds(fits: Mapping[str, Sequence[LaboratoryFit]]) -> None:
    """Check what recordings, by name, tell of the kind of physics; all have a fit of each kind.

    Raises:
        DatasetError: two are sure of different kinds; naming them.
    """
    for (name, first), (other, second) in combinations(fits.items(), 2):
        gains = [
            max(one.log_evidence - another.log_evidence for another in some if another is not one)
            if len(some) > 1
            else 0.0
            for some, one in ((first, _best(first)), (second, _best(second)))
        ]
        kinds = [_best(some).structure.name for some in (first, second)]
        if kinds[0] != kinds[1] and min(gains) > SURE_OF_KIND:
            raise DatasetError(
                f"{name} and {other} disagree about the kind of physics: {kinds[0]} and"
                f" {kinds[1]}, by logarithms of evidence of {gains[0]:.0f} and {gains[1]:.0f};"
                " identify each laboratory by itself"
            )


def _best(fits: Sequence[LaboratoryFit]) -> LaboratoryFit:
    return max(fits, key=lambda fit: fit.log_evidence)


def check_frictions(fits: Mapping[str, LaboratoryFit]) -> None:
    """Check what recordings, by name, tell of the frictions of one kind of physics.

    Raises:
        DatasetError: two disagree; naming them and the parameter that differs most.
    """
    worst, message = 1.0, ""
    for (name, first), (other, second) in combinations(fits.items(), 2):
        parameters = parameters_of(first.structure.config)
        for column, parameter in enumerate(parameters[:FRICTIONS]):
            apart, deviation, large = _difference(first, second, column)
            ratio = min(apart / (SURE * deviation), apart / large)
            if ratio > worst:
                values = [
                    values_at(fit.structure.config, fit.shared[None])[0, column]
                    for fit in (first, second)
                ]
                worst, message = (
                    ratio,
                    (
                        f"{name} and {other} disagree about {parameter.name}"
                        f" ({parameter.meaning}): {values[0]:.3g} and {values[1]:.3g},"
                        f" {apart / deviation:.0f} standard deviations apart; identify each"
                        " laboratory by itself"
                    ),
                )
    if message:
        raise DatasetError(message)


def _difference(
    first: LaboratoryFit, second: LaboratoryFit, column: int
) -> tuple[float, float, float]:
    """Return how far two values of z are apart, its standard deviation, and what is large."""
    apart = abs(float(first.shared[column] - second.shared[column]))
    if column != FRICTION:
        variance = first.covariance[column, column] + second.covariance[column, column]
        return apart, float(np.sqrt(variance)), LARGE
    scatter = [float(fit.frictions.std()) for fit in (first, second)]
    counts = [len(fit.frictions) for fit in (first, second)]
    variance = sum(max(s, SHARED) ** 2 / n for s, n in zip(scatter, counts, strict=True))
    shared = max(scatter) < SHARED
    return apart, float(np.sqrt(variance)), LARGE_FRICTION if shared else 1.0
