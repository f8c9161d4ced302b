"""The tool's way through a push, compiled: a straight line with a trapezoid speed profile."""

from typing import NamedTuple

import numpy as np

from sain_model.compute.compiling import compiled


class Profile(NamedTuple):
    """From rest to rest: speeding up for `ramp`, cruising, and braking for `ramp` until `end`."""

    length: float  # [m]
    acceleration: float  # [m/s^2]
    ramp: float  # [s]
    end: float  # [s]


@compiled
def make_profile(length, speed, acceleration):
    """Return the fastest profile over a length > 0 [m] within a speed and an acceleration."""
    ramp = min(speed / acceleration, np.sqrt(length / acceleration))
    return Profile(length, acceleration, ramp, ramp + length / (acceleration * ramp))


@compiled
def travelled(profile, time):
    """Return how far [m] the tool has come."""
    if time >= profile.end:
        return profile.length
    if time < profile.ramp:
        return 0.5 * profile.acceleration * time * time
    if time < profile.end - profile.ramp:
        return profile.acceleration * profile.ramp * (time - 0.5 * profile.ramp)
    return profile.length - 0.5 * profile.acceleration * (profile.end - time) ** 2


@compiled
def tool_speed(profile, time):
    """Return how fast [m/s] the tool moves."""
    return profile.acceleration * max(min(time, profile.ramp, profile.end - time), 0.0)


@compiled
def time_of(profile, distance):
    """Return when [s] the tool has come this far [m]: the inverse of `travelled`."""
    ramp_length = 0.5 * profile.acceleration * profile.ramp**2
    if distance < ramp_length:
        return np.sqrt(2.0 * distance / profile.acceleration)
    if distance <= profile.length - ramp_length:
        return distance / (profile.acceleration * profile.ramp) + 0.5 * profile.ramp
    left = max(profile.length - distance, 0.0)
    return profile.end - np.sqrt(2.0 * left / profile.acceleration)


@compiled
def until_kink(profile, time):
    """Return how long [s] the tool's acceleration stays as it is; infinite when it is over."""
    if time < profile.ramp - 1e-9:
        return profile.ramp - time
    if time < profile.end - profile.ramp - 1e-9:
        return profile.end - profile.ramp - time
    if time < profile.end - 1e-9:
        return profile.end - time
    return np.inf
