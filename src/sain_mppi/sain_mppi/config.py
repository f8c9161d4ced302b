"""The planner's settings."""

from dataclasses import dataclass

from sain_core.config import Config, option
from sain_mppi.cost import CostWeights
from sain_mppi.sampling import NoiseConfig


@dataclass(frozen=True)
class PlannerConfig(Config):
    """How the planner samples, weighs and decides."""

    samples: int = option(
        1024, "K, sequences rolled out in the first round", minimum=1, maximum=1_000_000
    )
    horizon: int = option(6, "H, pushes in a sequence", minimum=1, maximum=50)
    rounds: int = option(3, "rounds of sampling, each nearer the best so far", minimum=1)
    thinning: float = option(
        0.5, "factor on the samples from one round to the next", minimum=0.01, maximum=1.0
    )
    stuck_rounds: int = option(
        3, "more rounds, wide ones, when no sequence is better than doing nothing", minimum=0
    )
    temperature: float = option(
        0.05,
        "lambda, in units of the gap between the median and the smallest cost of a round;"
        " 0 picks the cheapest",
        minimum=0.0,
    )
    smoothing: float = option(
        0.1, "share of the last mean that stays at each update", minimum=0.0, maximum=1.0
    )
    selection: str = option(
        "argmin",
        "what is executed: the cheapest sequence (the paper's) or the weighted mean (MPPI's)",
        choices=("argmin", "mean"),
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
    noise: NoiseConfig = NoiseConfig()
    weights: CostWeights = CostWeights()

    def samples_in(self, round_number: int) -> int:
        """Return how many sequences a round rolls out, from 0."""
        return max(round(self.samples * self.thinning**round_number), 1)
