"""The planner's settings."""

from dataclasses import dataclass, replace
from typing import Final, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.config import Config, option
from sain_core.guarding.plugins import Plugins
from sain_core.push import DEFAULT_SPEED, PaperGrid
from sain_mppi.objective.cost_weights import CostWeights

MPPI_ROUNDS: Final = "mppi_rounds"
MPPI: Final = "mppi"
ICEM: Final = "icem"
EXHAUSTIVE: Final = "exhaustive"
GRADIENT: Final = "gradient"

ALGORITHM_NAMES: Final = (MPPI_ROUNDS, MPPI, ICEM, EXHAUSTIVE, GRADIENT)
PLANNERS: Final = Plugins("sain.planners", "planner", ALGORITHM_NAMES)

ARGMIN: Final = "argmin"
MEAN: Final = "mean"


@dataclass(frozen=True)
class NoiseConfig(Config):
    """How far samples scatter about the mean sequence in the first round, and after it."""

    location: float = option(0.5, "standard deviation of the location", unit="rad", minimum=0.0)
    angle: float = option(0.3, "standard deviation of the angle", unit="rad", minimum=0.0)
    length: float = option(0.04, "standard deviation of the length", unit="m", minimum=0.0)
    shrink: float = option(
        0.4, "factor on the deviations from one round to the next", minimum=0.01, maximum=1.0
    )
    spread: float = option(
        0.2,
        "smallest random factor on a sample's noise; the largest is 1",
        minimum=0.01,
        maximum=1.0,
    )

    def scaled(self, factor: float) -> Self:
        """Return noise that is so many times as wide."""
        wider = {name: factor * getattr(self, name) for name in ("location", "angle", "length")}
        return replace(self, **wider)

    def deviations(self, round_number: int) -> Float[ndarray, "3"]:
        """Return the standard deviations (location, angle, length) of a round, from 0."""
        scale = self.shrink**round_number
        return scale * np.array([self.location, self.angle, self.length])


@dataclass(frozen=True)
class IcemConfig(Config):
    """What iCEM has of its own; names as in Pinneri et al. 2020."""

    elites: int = option(
        10, "K, number of best samples to which mean and deviation are fitted", minimum=1
    )
    kept: float = option(
        0.3, "xi, share of the elites kept for the next round", minimum=0.0, maximum=1.0
    )
    colour: float = option(
        1.0, "beta, power of the noise's spectrum: 0 white, 2 a random walk", minimum=0.0
    )
    momentum: float = option(
        0.1,
        "alpha, share of the last mean and deviation that an update keeps",
        minimum=0.0,
        maximum=1.0,
    )


@dataclass(frozen=True)
class GradientConfig(Config):
    """What gradient descent has of its own."""

    drawn: float = option(
        0.5, "share of K that is sampled before the descent", minimum=0.0, maximum=1.0
    )
    descending: float = option(
        0.008, "share of K that descends in parallel: the best samples", minimum=0.0, maximum=1.0
    )
    steps: int = option(7, "number of descent steps", minimum=0)


@dataclass(frozen=True)
class BeamConfig(Config):
    """What the beam search tries before the rounds of `mppi_rounds`, where bodies have corners."""

    first: int = option(
        256, "single pushes to begin with; 0: no beam search", minimum=0, maximum=1_000_000
    )
    width: int = option(16, "sequences that are kept after each push", minimum=1, maximum=10_000)
    branch: int = option(
        12, "next pushes that are tried after each of them", minimum=1, maximum=10_000
    )
    samples: float = option(
        0.5, "factor on the samples of the rounds that follow", minimum=0.01, maximum=1.0
    )


@dataclass(frozen=True)
class ProgressConfig(Config):
    """When plans are made wider, or pushes slower, and when there is no point in going on."""

    surprise: float = option(
        0.01, "tolerated position error of a prediction", unit="m", minimum=0.0
    )
    surprise_share: float = option(
        0.3, "tolerated error as a share of the predicted path, if larger", minimum=0.0
    )
    careful_after: float = option(
        0.005,
        "mean error of predictions on the way to a goal, of the body that is farthest off, from"
        " which on pushes near the goal have `correction_speed`",
        unit="m",
        minimum=0.0,
    )
    stalled_after: int = option(3, "pushes without progress after which plans are wider", minimum=1)
    give_up_after: int = option(
        12, "pushes without progress after which the planner stops; 0: never", minimum=0
    )


@dataclass(frozen=True)
class PlannerConfig(Config):
    """How the planner samples, weighs and decides."""

    algorithm: str = option(
        MPPI_ROUNDS,
        f"search algorithm: {', '.join(ALGORITHM_NAMES)}, or one that an installed package offers",
    )
    samples: int = option(
        512, "K, sequences rolled out in the first round", minimum=1, maximum=1_000_000
    )
    horizon: int = option(4, "H, pushes in a sequence", minimum=1, maximum=50)
    rounds: int = option(3, "number of sampling rounds", minimum=1)
    thinning: float = option(
        0.5,
        "factor on the samples from one round to the next: 0.5 halves them",
        minimum=0.01,
        maximum=1.0,
    )
    stuck_rounds: int = option(
        3, "additional wide rounds if no sequence is better than no push", minimum=0
    )
    temperature: float = option(
        0.05,
        "lambda, in units of the gap between the median and the smallest cost of a round;"
        " 0 picks the cheapest",
        minimum=0.0,
    )
    smoothing: float = option(
        0.1, "share of the last mean that an update keeps", minimum=0.0, maximum=1.0
    )
    selection: str = option(
        ARGMIN,
        "what is executed: the cheapest sequence (the paper's) or the weighted mean (MPPI's)",
        choices=(ARGMIN, MEAN),
    )
    candidate_share: float = option(
        0.25, "share of informed proposals in each round", minimum=0.0, maximum=1.0
    )
    uniform_share: float = option(
        0.25, "share of uniform draws in the first round", minimum=0.0, maximum=1.0
    )
    stop_share: float = option(
        0.3, "share of random sequences that rest after a random push", minimum=0.0, maximum=1.0
    )
    deadline: float = option(
        0.0, "time limit of a plan; 0: none", unit="s", minimum=0.0, maximum=3600.0
    )
    ahead: bool = option(
        True, "plan the next push during a push, from the scene that is predicted after it"
    )
    correction: int = option(
        192, "samples of the one round that corrects such a plan in the real scene", minimum=1
    )
    speeds: tuple[float, ...] = option(
        (DEFAULT_SPEED,), "speeds among which pushes are drawn", unit="m/s", minimum=0.01
    )
    correction_speed: float = option(
        0.05,
        "speed of pushes that correct, near the goal, after errors of predictions:"
        " see `progress.careful_after`",
        unit="m/s",
        minimum=0.01,
    )
    correction_within: float = option(
        0.03,
        "distance of all bodies to their poses from which on pushes correct",
        unit="m",
        minimum=0.0,
    )
    warm_start: bool = option(True, "start from the rest of the last plan")
    widening: float = option(
        2.0,
        "factor on samples and noise after large prediction errors or without progress",
        minimum=1.0,
    )
    shown: int = option(
        24, "number of other sequences published with a plan", minimum=0, maximum=1000
    )
    noise: NoiseConfig = NoiseConfig()
    beam: BeamConfig = BeamConfig()
    icem: IcemConfig = IcemConfig()
    gradient: GradientConfig = GradientConfig()
    grid: PaperGrid = PaperGrid()
    progress: ProgressConfig = ProgressConfig()
    weights: CostWeights = CostWeights()

    def __post_init__(self) -> None:
        """Check the fields and the name of the algorithm."""
        super().__post_init__()
        PLANNERS.check(self.algorithm)

    def widened(self) -> Self:
        """Return settings that look further about: more samples, more noise, no warm start."""
        return replace(
            self,
            samples=round(self.widening * self.samples),
            noise=self.noise.scaled(self.widening),
            warm_start=False,
        )

    def correcting(self) -> Self:
        """Return settings that correct a plan that was made for almost the same scene."""
        return replace(
            self,
            samples=self.correction,
            rounds=1,
            beam=replace(self.beam, first=0),
            noise=self.noise.scaled(self.noise.shrink),
            uniform_share=0.0,
        )

    def slowed(self) -> Self:
        """Return settings for pushes that correct what is left near the goal."""
        return replace(self, speeds=(self.correction_speed,))

    def samples_in(self, round_number: int) -> int:
        """Return how many sequences a round rolls out, from 0."""
        return max(round(self.samples * self.thinning**round_number), 1)
