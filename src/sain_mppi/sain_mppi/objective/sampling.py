"""Random push sequences inside the limits, with nothing piled up on their bounds."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.config import Config, option
from sain_core.push import (
    ANGLE,
    BODY,
    LENGTH,
    LOCATION,
    PATH,
    PUSH_SIZE,
    SPEED,
    PushLimits,
    idle_pushes,
)
from sain_core.scene import wrap_angle
from sain_core.types import PushArray, Pushes, PushSequences, Scalars

Sequence = Float[ndarray, "H 5"]


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


def reflect(values: Scalars, low: float, high: float) -> Scalars:
    """Fold values back into [low, high] as between two mirrors.

    Unlike clipping it leaves no samples piled up on the bounds.
    """
    span = high - low
    if span == 0.0:
        return np.full_like(values, low)
    folded = np.abs(np.mod(values - low + span, 2 * span) - span)
    return np.clip(low + folded, low, high)  # rounding only


def inside_limits(pushes: PushSequences, limits: PushLimits) -> PushSequences:
    """Bring pushes (..., 5) into the limits: locations wrap, angles, lengths and speeds reflect."""
    inside = pushes.copy()
    inside[..., LOCATION] = wrap_angle(pushes[..., LOCATION])
    inside[..., ANGLE] = reflect(pushes[..., ANGLE], -limits.max_angle, limits.max_angle)
    inside[..., LENGTH] = reflect(pushes[..., LENGTH], 0.0, limits.max_length)
    inside[..., SPEED] = reflect(pushes[..., SPEED], limits.min_speed, limits.max_speed)
    return inside


def gaussian_sequences(
    mean: Sequence | PushSequences,
    deviations: Float[ndarray, "3"],
    spread: float,
    limits: PushLimits,
    generator: np.random.Generator,
    count: int,
) -> PushSequences:
    """Draw sequences (count, H, 5) about a mean (H, 5), or each about its own (count, H, 5).

    Each has its own scale of noise.
    """
    scale = np.exp(generator.uniform(np.log(spread), 0.0, (count, 1, 1)))
    drawn = np.broadcast_to(mean, (count, *mean.shape[-2:])).copy()
    noise = generator.standard_normal(drawn[..., PATH].shape) * deviations * scale
    drawn[..., PATH] += noise
    return inside_limits(drawn, limits)


def coloured_noise(
    generator: np.random.Generator, shape: tuple[int, ...], colour: float
) -> Float[ndarray, "..."]:
    """Draw noise of variance 1 whose power falls with frequency^colour along the last axis.

    After Timmer and Koenig 1995: random amplitudes in the frequency domain. The mean over the
    axis counts as the lowest frequency there is, so that a whole sequence may shift.
    """
    length = shape[-1]
    frequency = np.maximum(np.fft.rfftfreq(length), 1.0 / length)
    scale = frequency ** (-colour / 2.0)
    draws = generator.standard_normal((2, *shape[:-1], len(scale)))
    spectrum = scale * (draws[0] + 1j * draws[1])
    real = np.zeros(len(scale), bool)
    real[0] = True
    real[-1] |= length % 2 == 0  # the highest frequency of an even length
    spectrum[..., real] = 2**0.5 * spectrum[..., real].real
    power = scale**2 * np.where(real, 1.0, 2.0)
    deviation = np.sqrt(2.0 * power.sum()) / length
    return np.asarray(np.fft.irfft(spectrum, n=length, axis=-1) / deviation)


def uniform_sequences(
    limits: PushLimits, generator: np.random.Generator, count: int, horizon: int
) -> PushSequences:
    """Draw sequences (count, H, 5) of pushes from any side, of any allowed angle and length."""
    return limits.sample(generator, count * horizon).reshape(count, horizon, PUSH_SIZE)


def stop_early(
    sequences: PushSequences, share: float, generator: np.random.Generator
) -> PushSequences:
    """Let a share of the sequences rest after a random push, so that the plan can be short."""
    count, horizon, _ = sequences.shape
    stop = generator.integers(1, horizon + 1, count)
    stop[generator.uniform(size=count) >= share] = horizon
    stopped = sequences.copy()
    stopped[..., LENGTH] *= np.arange(horizon) < stop[:, None]
    return stopped


def weighted_mean(sequences: PushSequences, weights: Scalars) -> Sequence:
    """Return the mean (H, 5) of sequences (K, H, 5); locations are averaged on the circle.

    Each push of the mean is of those against the body with most weight.
    """
    bodies = sequences[0, :, BODY]
    if (sequences[..., BODY] != bodies).any():
        return np.stack([_mean_push(step, weights) for step in sequences.swapaxes(0, 1)])
    mean = np.einsum("k,khp->hp", weights, sequences)
    sine = weights @ np.sin(sequences[..., LOCATION])
    cosine = weights @ np.cos(sequences[..., LOCATION])
    mean[:, LOCATION], mean[:, BODY] = wrap_angle(np.arctan2(sine, cosine)), bodies
    return mean


def _mean_push(pushes: Pushes, weights: Scalars) -> PushArray:
    """Return the mean (5,) of the pushes (K, 5) against the body that has most of the weight."""
    _, which = np.unique(pushes[:, BODY], return_inverse=True)
    best = int(np.argmax(np.bincount(which, weights=weights)))
    mine = which == best
    of_body = weights[mine] / weights[mine].sum()
    return np.asarray(weighted_mean(pushes[mine, None], of_body)[0])


def shift(sequences: PushSequences) -> PushSequences:
    """Drop the first push of sequences (K, H, 5), which was executed, and rest at their ends."""
    shifted = np.roll(sequences, -1, axis=-2)
    shifted[..., -1, :] = idle_pushes()
    return shifted
