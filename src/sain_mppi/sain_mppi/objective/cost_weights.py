"""The settings of the cost terms in `sain_mppi.objective.cost`."""

from dataclasses import dataclass
from functools import cache
from math import isfinite
from typing import Final

from sain_core.config import Config, option
from sain_core.errors import ConfigError
from sain_core.guarding.plugins import Plugins

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
    done_within: float = option(
        0.01,
        "distance to the goal below which alignment, approach and reach fade out",
        unit="m",
        minimum=0.001,
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
        2.0, "weight of a gap below `tool_gap` between tool and another body", minimum=0.0
    )
    tool_gap: float = option(
        0.01, "gap below which the clearance cost begins", unit="m", minimum=0.001
    )
    reach: float = option(
        3.0, "weight of pushing body or target near the limits of the reach", minimum=0.0
    )
    reach_margin: float = option(
        0.10, "distance to the limits below which the reach cost begins", unit="m", minimum=0.001
    )
    blocked: float = option(3.0, "cost of each later push that is not feasible", minimum=0.0)
    effort: float = option(0.05, "weight of the tool's travel", unit="1/m", minimum=0.0)
    pushes: float = option(0.01, "cost of each push of non-zero length", minimum=0.0)
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
        """Check the fields and the further terms."""
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
