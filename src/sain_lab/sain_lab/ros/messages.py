"""What a laboratory has learned, as a message."""

from typing import Final

import numpy as np
from builtin_interfaces.msg import Time
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.ros.codec import encode_time, header
from sain_interfaces.msg import LearnedCurve, LearnerEvent, Learning
from sain_lab.judging.curves import SERVICE, WINDOW, Curves
from sain_lab.keeping.events import Event
from sain_lab.keeping.laboratory import PHYSICS, PLANAR
from sain_model.physics.parameters import BY_NAME

PLACES: Final = 60  # of a curve
EVENTS: Final = 20
QUANTILE: Final = 1.96  # standard deviations of a 95 % interval
NAMES: Final = {PHYSICS: "physics", PLANAR: "planar", SERVICE: SERVICE}


def encode_learning(
    curves: Curves, *, stamp: Time, laboratory: str, service: str, waiting: int
) -> Learning:
    """Return the curves and events of a laboratory."""
    return Learning(
        header=header(stamp),
        laboratory=laboratory,
        service=NAMES.get(service, service),
        pushes=curves.pushes,
        waiting=waiting,
        errors=[_error_curve(curves, name) for name in (PLANAR, PHYSICS, SERVICE)],
        parameters=[_parameter_curve(name, rows) for name, rows in curves.parameters.items()],
        events=[encode_event(event) for event in curves.events[-EVENTS:]],
    )


def encode_event(event: Event) -> LearnerEvent:
    """Return an event."""
    stamp = encode_time(round(1e9 * event.time))
    return LearnerEvent(stamp=stamp, kind=event.kind, text=event.text, pushes=event.pushes)


def spaced(count: int, most: int = PLACES) -> Int[ndarray, "C"]:
    """Return up to so many of the numbers 1 to count, evenly by their logarithm, with the last."""
    if not count:
        return np.empty(0, np.int64)
    return np.unique(np.geomspace(1, count, min(most, count)).round().astype(np.int64))


def _error_curve(curves: Curves, name: str) -> LearnedCurve:
    """Return the mean error over the latest pushes [m] with its 95 % interval."""
    values, at = 1e-3 * curves.errors[name], spaced(curves.pushes)
    rows = []
    for place in at:
        some = values[max(place - WINDOW, 0) : place]
        some = some[np.isfinite(some)]
        mean = some.mean() if len(some) else np.nan
        half = QUANTILE * some.std(ddof=1) / np.sqrt(len(some)) if len(some) > 1 else np.nan
        rows.append((mean, mean - half, mean + half))
    return _curve(NAMES[name], "m", at, np.array(rows).reshape(-1, 3))


def _parameter_curve(name: str, rows: Float[ndarray, "C 3"]) -> LearnedCurve:
    """Return a parameter with its 95 % interval."""
    rows = rows[spaced(len(rows)) - 1]
    value, half = rows[:, 1], QUANTILE * rows[:, 2]
    if BY_NAME[name].logarithm:
        low, high = value * np.exp(-half), value * np.exp(half)
    else:
        low, high = value - half, value + half
    return _curve(name, BY_NAME[name].unit, rows[:, 0], np.stack([value, low, high], axis=1))


def _curve(name: str, unit: str, at: ndarray, rows: Float[ndarray, "C 3"]) -> LearnedCurve:
    value, low, high = (column.astype(np.float32) for column in rows.T)
    pushes = at.astype(np.uint32)
    return LearnedCurve(name=name, unit=unit, pushes=pushes, value=value, low=low, high=high)
