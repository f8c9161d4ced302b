"""What a round tries: samples about the mean, informed candidates, uniform draws."""

import numpy as np

from sain_core.feasibility import Feasibility
from sain_core.push import LENGTH, PushLimits
from sain_core.types import Mask, Pushes, PushSequences, Scene
from sain_mppi.candidates import go_around_sequences, straight_sequences
from sain_mppi.config import PlannerConfig
from sain_mppi.goal import Goal
from sain_mppi.sampling import (
    Sequence,
    gaussian_sequences,
    stop_early,
    uniform_sequences,
)

STRAIGHT_SHARE = 0.25  # of the candidates; the others go around
SURPLUS = 2  # sequences drawn for each one wanted: first pushes that are not permitted are dropped


def propose(
    scene: Scene,
    goal: Goal,
    mean: Sequence | None,
    round_number: int,
    config: PlannerConfig,
    limits_of: Feasibility,
    generator: np.random.Generator,
) -> PushSequences:
    """Draw twice the sequences (2 K, H, 3) that a round rolls out, shuffled.

    Without a mean what would be drawn about it is drawn uniformly.
    """
    limits = limits_of.limits
    count = SURPLUS * config.samples_in(round_number)
    informed = round(count * config.candidate_share)
    straight = round(informed * STRAIGHT_SHARE)
    about_mean = count - informed
    if mean is None:
        about_mean = 0
    elif round_number == 0:
        about_mean -= min(round(count * config.uniform_share), about_mean)
    uniform = count - informed - about_mean
    horizon = config.horizon
    drawn = uniform_sequences(limits, generator, uniform, horizon)
    parts = [
        straight_sequences(scene, goal, limits, generator, straight, horizon),
        go_around_sequences(scene, goal, limits, generator, informed - straight, horizon),
        stop_early(drawn, config.stop_share, generator),
    ]
    if mean is not None:
        deviations = config.noise.deviations(round_number)
        near = gaussian_sequences(
            mean, deviations, config.noise.spread, limits, generator, about_mean
        )
        parts.append(stop_early(near, config.stop_share, generator))
    return np.asarray(generator.permutation(without_idle(np.concatenate(parts), limits)))


def without_idle(sequences: PushSequences, limits: PushLimits) -> PushSequences:
    """Make rests of pushes (K, H, 3) that would end before they touch the mid disk."""
    touching = sequences[..., LENGTH] > limits.clearance
    sequences[..., LENGTH] *= touching
    return sequences


def permitted(scene: Scene, pushes: Pushes, feasibility: Feasibility) -> Mask:
    """Tell which pushes (B, 3) could be carried out now and would touch the mid disk."""
    scenes = np.broadcast_to(scene, (len(pushes), *scene.shape))
    moving = pushes[:, LENGTH] > feasibility.limits.clearance
    return np.asarray(feasibility.mask(scenes, pushes) & moving)
