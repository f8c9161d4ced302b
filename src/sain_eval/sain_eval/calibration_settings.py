"""Settings of the calibration; they load without Numba."""

from dataclasses import dataclass

from sain_core.config import Config, option


@dataclass(frozen=True)
class CalibrationConfig(Config):
    """How the parameters are fitted."""

    fit_share: float = option(
        0.25,
        "share of the episodes used for the fit; the others are the test",
        minimum=0.05,
        maximum=0.9,
    )
    evaluations: int = option(600, "largest number of evaluations of the prior", minimum=1)
    seed: int = option(0, "seed of the choice of episodes", minimum=0)
    axes: bool = option(False, "fit the prior whose friction depends on the world's axes")
