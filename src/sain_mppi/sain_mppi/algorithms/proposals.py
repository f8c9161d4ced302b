"""What an algorithm tries: samples about the mean, informed candidates, uniform draws."""

from collections.abc import Callable
from typing import Final

import numpy as np

from sain_core.errors import NoPushError
from sain_core.push import LENGTH, PushLimits
from sain_core.types import PushSequences
from sain_mppi.algorithms.search import Search
from sain_mppi.objective.sampling import (
    Sequence,
    gaussian_sequences,
    stop_early,
)

RESET: Final = "reset the scene: ./env ros2 run sain_bringup reset"
SURPLUS: Final = 2  # sequences drawn for each one wanted: those are dropped whose first push is
# not permitted
LAST_RESORT: Final = 256  # uniform draws in a hard place, besides four for each one wanted


def draw_permitted(
    search: Search,
    draw: Callable[[int], PushSequences],
    count: int,
    generator: np.random.Generator,
) -> PushSequences:
    """Return up to so many sequences (K, H, 5) whose first push can be carried out.

    `draw` returns about as many sequences as it is asked for, the dearest to it first. Uniform
    draws are added where most of them are blocked.

    Raises:
        NoPushError: no first push is permitted.
    """
    sequences = draw(SURPLUS * count)
    sequences = sequences[search.permitted(sequences[:, 0])]
    if len(sequences) < count:
        wanted = 4 * count + LAST_RESORT
        more = search.objective.uniform(generator, wanted, search.config.horizon)
        sequences = np.concatenate([sequences, more[search.permitted(more[:, 0])]])
    if not len(sequences):
        raise NoPushError(
            f"no push can be carried out {search.where}; move a body by hand, or {RESET}"
        )
    return np.asarray(sequences[:count])


def propose(
    search: Search,
    mean: Sequence | None,
    round_number: int,
    generator: np.random.Generator,
    count: int,
) -> PushSequences:
    """Draw sequences (count, H, 3) of all kinds, shuffled; behind the mean, where there is one.

    Without a mean what would be drawn about it is drawn uniformly.
    """
    config = search.config
    objective, limits = search.objective, search.feasibility.limits
    informed = round(count * config.candidate_share)
    about_mean = count - informed
    if mean is None:
        about_mean = 0
    elif round_number == 0:
        about_mean -= min(round(count * config.uniform_share), about_mean)
    uniform = count - informed - about_mean
    horizon = config.horizon
    drawn = objective.uniform(generator, uniform, horizon)
    parts = [
        objective.candidates(search.scene, generator, informed, horizon),
        stop_early(drawn, config.stop_share, generator),
    ]
    if mean is not None:
        deviations = config.noise.deviations(round_number)
        about = mean
        if len(search.known):  # about each in turn
            about = search.known[np.arange(about_mean) % len(search.known)]
        near = gaussian_sequences(
            about, deviations, config.noise.spread, limits, generator, about_mean
        )
        parts.append(stop_early(near, config.stop_share, generator))
    drawn = generator.permutation(without_idle(np.concatenate(parts), limits))
    return np.asarray(drawn if mean is None else np.concatenate([mean[None], drawn]))


def without_idle(sequences: PushSequences, limits: PushLimits) -> PushSequences:
    """Make rests of pushes (K, H, 5) that would end before they touch the mid disk."""
    touching = sequences[..., LENGTH] > limits.clearance
    sequences[..., LENGTH] *= touching
    return sequences
