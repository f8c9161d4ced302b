"""The parameters of the planar prior that pushes can tell, each in units of its spread.

A vector z has one number for each parameter. 0 is what a `PlanarConfig` states, and 1 is one spread
away: a logarithm for `factor`s, else a difference. Values are held inside their ranges. The last
parameter is the ratio of masses: vectors are without it where masses are measured.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.types import Scalars
from sain_model.identification.varied_pushes import PhysicsRows
from sain_model.physics.body_kernels import Physics
from sain_model.physics.planar_config import PlanarConfig

Places = Float[ndarray, "R D"]  # a vector z for each of R rows


class Parameter(NamedTuple):
    """One parameter, and what is believed of it before any push.

    Attributes:
        name: the field of `PlanarConfig`.
        meaning: in plain words.
        spread: standard deviation beforehand.
        factor: whether the spread is that of the logarithm.
        least: smallest value.
        most: largest value.
    """

    name: str
    meaning: str
    spread: float
    factor: bool
    least: float
    most: float


FRICTION: Final = 0  # the place of the table's friction among the parameters
COMMON: Final = (
    Parameter("friction", "friction with the table", 0.5, True, 0.005, 2.0),
    Parameter("tool_friction", "friction with the tool", 0.5, True, 0.01, 1.5),
    Parameter("disk_friction", "friction between bodies", 0.5, True, 0.01, 1.5),
    Parameter("tool_restitution", "bounce off the tool, share of speed", 0.15, False, 0.0, 0.8),
    Parameter("disk_restitution", "bounce between bodies, share of speed", 0.15, False, 0.0, 0.8),
    Parameter("foot_radius", "where supports stand, share of the radius", 0.1, True, 0.3, 1.0),
    Parameter("inertia", "moment of inertia, share of mass x radius^2", 0.2, True, 0.1, 1.0),
    Parameter("tool_height", "height at which the tool presses, m", 0.008, False, 0.0, 0.05),
    Parameter("disk_height", "height at which bodies press, m", 0.008, False, 0.0, 0.05),
    Parameter("middle_height", "height of the centre of mass, m", 0.004, False, 0.0, 0.04),
    Parameter("speed", "speed of the tool, m/s", 0.05, True, 0.005, 0.5),
)
ACROSS: Final = Parameter(
    "yield_across", "friction of a foot across its arm, share", 0.15, False, 0.3, 1.0
)
ALONG_AXES: Final = Parameter(
    "axes_yield", "give of the friction along the solver's axes", 0.3, False, 0.3, 3.0
)
RATIO: Final = Parameter(
    "mass_ratio", "masses of bodies 1 and on over that of body 0, times stated", 0.3, True, 0.1, 10
)


def parameters_of(config: PlanarConfig) -> tuple[Parameter, ...]:
    """Return all parameters of a prior; one with a solver's axes has one that others lack."""
    return (*COMMON, ALONG_AXES if config.has_axes else ACROSS, RATIO)


COUNT: Final = len(COMMON) + 1  # D where masses are measured; else one more
MASS_RATIO: Final = COUNT  # the place of the ratio of masses among the parameters


def values_at(config: PlanarConfig, places: Places) -> Float[ndarray, "R D"]:
    """Return the values of all parameters at vectors z (R, D)."""
    values = np.empty_like(places)
    for column, parameter in enumerate(parameters_of(config)[: places.shape[1]]):
        base, away = getattr(config, parameter.name), parameter.spread * places[:, column]
        value = base * np.exp(away) if parameter.factor else base + away
        values[:, column] = np.clip(value, parameter.least, parameter.most)
    return values


def physics_at(config: PlanarConfig, places: Places) -> tuple[Scalars, PhysicsRows]:
    """Return the friction with the table (R,) and the numbers of the physics (R, 20)."""
    values = values_at(config, places[:, :COUNT])
    rows = np.tile(np.array(config.physics()), (len(places), 1))
    rows[:, _columns(config)] = values[:, 1:]
    return np.ascontiguousarray(values[:, FRICTION]), rows


def mass_ratio_at(config: PlanarConfig, places: Places) -> Scalars:
    """Return the ratio of masses (R,) at vectors z (R, D)."""
    if places.shape[1] <= MASS_RATIO:
        return np.full(len(places), config.mass_ratio)
    return np.ascontiguousarray(values_at(config, places)[:, MASS_RATIO])


def mass_factor(places: Places) -> Scalars:
    """Return the ratio of masses (R,) at vectors z (R, D), times that of the prior; 1: measured."""
    return np.asarray(np.exp(RATIO.spread * places[:, MASS_RATIO:].sum(axis=1)))


def config_at(config: PlanarConfig, place: Float[ndarray, "D"]) -> PlanarConfig:
    """Return the settings of a prior at one vector z (D,)."""
    values = values_at(config, place[None])[0]
    names = (parameter.name for parameter in parameters_of(config)[: len(place)])
    return replace(config, **dict(zip(names, values.tolist(), strict=True)))


def _columns(config: PlanarConfig) -> Sequence[int]:
    return [Physics._fields.index(one.name) for one in parameters_of(config)[1:COUNT]]
