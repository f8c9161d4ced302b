"""The planner's settings."""

from dataclasses import dataclass, replace
from functools import cache
from math import isfinite
from typing import Final, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.guarding.plugins import Plugins
from sain_core.push import DEFAULT_SPEED, PaperGrid

COSTS: Final = Plugins("sain.costs", "cost")


@dataclass(frozen=True)
class CostWeights(Config):
    """The weights of the cost terms and the distances at which they set in."""

    position: tuple[float, float] = option(
        (100.0, 100.0), "Q for x and y of bodies with poses, paper eq. 6", unit="1/m^2", minimum=0.0
    )
    running: float = option(0.5, "share of Q after every push but the last", minimum=0.0)
    distance: float = option(
        50.0,
        "weight of the distances of bodies to their poses after the last push, not squared",
        unit="1/m",
        minimum=0.0,
    )
    alignment: float = option(
        1.0,
        "weight of the angle between the lines pushing body to target and target to goal",
        minimum=0.0,
    )
    approach: float = option(
        2.0,
        "weight of the pushing body's distance from the point behind the target",
        unit="1/m",
        minimum=0.0,
    )
    caution: float = option(
        10.0,
        "weight of predicted overshoot to where the arm cannot push back",
        unit="1/m",
        minimum=0.0,
    )
    uncertainty: float = option(
        0.1, "assumed overshoot, as a share of the target's path", minimum=0.0, maximum=1.0
    )
    clearance: float = option(
        2.0, "weight of a gap below 1 cm between tool and another body", minimum=0.0
    )
    reach: float = option(
        3.0, "weight of pushing body or target near the limits of the reach", minimum=0.0
    )
    blocked: float = option(3.0, "cost of each later push that is not feasible", minimum=0.0)
    duration: float = option(
        0.1, "weight of the time that strokes, ways and looks take", unit="1/s", minimum=0.0
    )
    lever: float = option(
        1.0,
        "weight of a heading, as the distance of points from a body's middle, in"
        " circumscribed radii",
        minimum=0.0,
    )
    running_distance: float = option(
        5.0, "weight of the distances after all pushes but the last", unit="1/m", minimum=0.0
    )
    around: float = option(
        100.0,
        "weight of a body where the tool cannot get behind it, or beside one that it pushes",
        unit="1/m",
        minimum=0.0,
    )
    overhang: float = option(
        100.0, "weight of what sticks out over the table's edge", unit="1/m", minimum=0.0
    )
    stranded: float = option(
        20.0,
        "shapes: weight of lacking room for pushing body and tool behind the target",
        unit="1/m",
        minimum=0.0,
    )
    more: str = option("", "further terms that installed packages offer, with commas: NAME:WEIGHT")
    keep: float = option(
        200.0, "weight of moving a body that is to be kept", unit="1/m", minimum=0.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        further_terms(self.more)


@cache
def further_terms(text: str) -> tuple[tuple[str, float], ...]:
    """Return names and weights of cost terms that packages offer; nothing is imported.

    Raises:
        ConfigError: another text than ``NAME:WEIGHT,NAME:WEIGHT``, or a name that is not offered.
    """
    found: dict[str, float] = {}
    for word in filter(None, (word.strip() for word in text.split(","))):
        name, _, number = word.partition(":")
        try:
            weight = float(number)
        except ValueError:
            weight = -1.0
        if not (isfinite(weight) and weight >= 0.0) or name in found:
            raise ConfigError(
                f"more is {text!r}; allowed: NAME:WEIGHT with commas, each name once, weights of at"
                " least 0, for example near_edge:2.0"
            )
        COSTS.check(name)
        found[name] = weight
    return tuple(found.items())


MPPI_ROUNDS: Final = "mppi_rounds"
MPPI: Final = "mppi"
EXHAUSTIVE: Final = "exhaustive"

ALGORITHM_NAMES: Final = (MPPI_ROUNDS, MPPI, EXHAUSTIVE)
PLANNERS: Final = Plugins("sain.planners", "planner", ALGORITHM_NAMES)

ARGMIN: Final = "argmin"
MEAN: Final = "mean"


DEVIATIONS: Final = np.array([0.5, 0.3, 0.04])  # [rad, rad, m], of location, angle and length
SHRINK: Final = 0.4  # factor on the deviations from one round to the next
FINE: Final = 0.01  # [m], tolerance up to which pushes that correct are slowest
WIDENING: Final = 2.0  # factor on samples and noise after large errors or without progress


@dataclass(frozen=True)
class ProgressConfig(Config):
    """When plans are made wider, and when there is no point in going on."""

    stalled_after: int = option(
        3,
        "pushes without progress after which plans are wider, and the reason is reported",
        minimum=1,
    )
    give_up_after: int = option(
        12,
        "pushes that lowered the cost by less than a tenth in all, after which the planner stops;"
        " 0: never",
        minimum=0,
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
    selection: str = option(
        ARGMIN,
        "what is executed: the cheapest sequence (the paper's) or the weighted mean (MPPI's)",
        choices=(ARGMIN, MEAN),
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
        (DEFAULT_SPEED, 2 * DEFAULT_SPEED),
        "speeds among which pushes are drawn; the first one where a body is hit by another",
        unit="m/s",
        minimum=0.01,
    )
    correction_speed: float = option(
        0.05,
        "speed of pushes that correct: near the goal, all but the first one on the way to it; more"
        " in proportion for a tolerance of over 1 cm",
        unit="m/s",
        minimum=0.01,
    )
    correction_within: float = option(
        0.06,
        "distance of all bodies to their poses from which on pushes correct",
        unit="m",
        minimum=0.0,
    )
    noise: float = option(
        1.0,
        "factor on the standard deviations of samples about the mean sequence in the first round:"
        " 0.5 rad of the location, 0.3 rad of the angle, 0.04 m of the length",
        minimum=0.0,
    )
    beam: int = option(
        256,
        "single pushes that a beam search begins with, before the rounds of `mppi_rounds`, where"
        " bodies have corners; 0: no beam search",
        minimum=0,
        maximum=1_000_000,
    )
    warm_start: bool = option(True, "start from the rest of the last plan")
    shown: int = option(
        24, "number of other sequences published with a plan", minimum=0, maximum=1000
    )
    grid: PaperGrid = PaperGrid()
    progress: ProgressConfig = ProgressConfig()
    weights: CostWeights = CostWeights()

    def __post_init__(self) -> None:
        super().__post_init__()
        PLANNERS.check(self.algorithm)

    def widened(self) -> Self:
        """Return settings that look further about: more samples, more noise, no warm start."""
        return replace(
            self,
            samples=round(WIDENING * self.samples),
            noise=WIDENING * self.noise,
            warm_start=False,
        )

    def speed_near(self, tolerance: float) -> float:
        """Return the speed [m/s] of pushes that correct, for a tolerance of the goal [m]."""
        speed = self.correction_speed * max(tolerance / FINE, 1.0)
        return min(speed, max(self.correction_speed, *self.speeds))

    def correcting(self) -> Self:
        """Return settings that correct a plan that was made for almost the same scene."""
        return replace(
            self,
            samples=self.correction,
            rounds=1,
            beam=0,
            noise=SHRINK * self.noise,
            uniform_share=0.0,
        )

    def deviations(self, round_number: int) -> Float[ndarray, "3"]:
        """Return the standard deviations (location, angle, length) of a round, from 0."""
        return np.asarray(SHRINK**round_number * (self.noise * DEVIATIONS))

    def samples_in(self, round_number: int) -> int:
        """Return how many sequences a round rolls out, from 0."""
        return max(round(self.samples * self.thinning**round_number), 1)
