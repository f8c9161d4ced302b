"""Cost terms that installed packages offer, beside those of `sain_mppi.objective.cost`."""

from collections.abc import Callable
from functools import cache
from importlib.metadata import EntryPoint
from typing import Any

import numpy as np

from sain_core.types import Scalars
from sain_mppi.objective.cost import Rollout
from sain_mppi.objective.cost_weights import COSTS, further_terms

Cost = Callable[[Rollout, Any], Scalars]
"""Returns what each of K predicted sequences costs (K,), unweighted, for an `Objective`."""


def further_costs(
    text: str, rollout: Rollout, objective: Any, own: dict[str, Scalars]
) -> dict[str, Scalars]:
    """Return the weighted terms (K,) that a setting names, as `further_terms` reads it.

    Raises:
        ConfigError: a package that fails, another shape than (K,), or the name of one of our `own`.
    """
    terms = {}
    for name, weight in further_terms(text):
        entry, cost = find_cost(name)
        values = np.asarray(cost(rollout, objective), dtype=np.float64)
        if values.shape != (len(rollout.pushes),):
            shape = f"({len(rollout.pushes)},)"
            raise COSTS.wrong(entry, f"it returned the shape {values.shape}; it must be {shape}")
        if name in own:
            raise COSTS.wrong(entry, "a term of SAIN has this name; rename it")
        terms[name] = weight * values
    return terms


@cache
def find_cost(name: str) -> tuple[EntryPoint, Cost]:
    """Return the cost term of this name, and who offers it.

    Raises:
        ConfigError: nobody offers it, two packages do, or its package fails.
    """
    entry = COSTS.find(name)
    cost = COSTS.load(entry)
    if not callable(cost):
        raise COSTS.wrong(entry, f"{entry.value} is a {type(cost).__name__}; it must be a function")
    return entry, COSTS.guarded(entry, cost)
