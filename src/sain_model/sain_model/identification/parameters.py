"""The parameters of the planar prior that pushes can tell, each in units of its spread.

A vector z has one number for each parameter. 0 is what a `PlanarConfig` states, and 1 is one spread
away: a logarithm for `factor`s, else a difference. Values are held inside their ranges. The last
parameter is the ratio of masses: vectors are without it where masses are measured.
"""

from dataclasses import replace
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.types import Scalars
from sain_model.physics.parameters import BY_NAME, Parameter
from sain_model.physics.planar_config import PlanarConfig

Places = Float[ndarray, "R D"]  # a vector z for each of R rows


FRICTION: Final = 0  # the place of the table's friction among the parameters
COMMON: Final = tuple(
    BY_NAME[name]
    for name in (
        "friction", "tool_friction", "disk_friction", "tool_restitution", "disk_restitution",
        "foot_radius", "inertia", "tool_height", "disk_height", "middle_height", "speed_factor",
    )
)  # fmt: skip
ACROSS: Final = BY_NAME["yield_across"]
ALONG_AXES: Final = BY_NAME["axes_yield"]
RATIO: Final = BY_NAME["mass_ratio"]


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
        value = base * np.exp(away) if parameter.logarithm else base + away
        values[:, column] = np.clip(value, parameter.least, parameter.most)
    return values


def named_values_at(config: PlanarConfig, places: Places) -> dict[str, Scalars]:
    """Return the values (R,) of parameters at vectors z (R, D), by name."""
    names = (parameter.name for parameter in parameters_of(config)[: places.shape[1]])
    return dict(zip(names, values_at(config, places).T, strict=True))


def mass_factor(places: Places) -> Scalars:
    """Return the ratio of masses (R,) at vectors z (R, D), times that of the prior; 1: measured."""
    return np.asarray(np.exp(RATIO.spread * places[:, MASS_RATIO:].sum(axis=1)))


def config_at(config: PlanarConfig, place: Float[ndarray, "D"]) -> PlanarConfig:
    """Return the settings of a prior at one vector z (D,)."""
    values = values_at(config, place[None])[0]
    names = (parameter.name for parameter in parameters_of(config)[: len(place)])
    return replace(config, **dict(zip(names, values.tolist(), strict=True)))
