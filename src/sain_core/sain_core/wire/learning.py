"""What a learner said of its laboratory, from a message ``Learning``, received or recorded."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.errors import InvalidInputError

MOST_PLACES: Final = 1000  # of a curve


@dataclass(frozen=True, eq=False)
class LearnedCurve:
    """A quantity against the number of pushes learned from."""

    name: str
    unit: str  # empty: a share, a factor, or the coefficient of a friction
    pushes: Int[ndarray, "C"]  # in order
    values: Float[ndarray, "C 3"]  # it, and the ends of its 95 % interval; NaN: not known


@dataclass(frozen=True, eq=False)
class Learned:
    """What a laboratory has learned so far."""

    laboratory: str  # its name
    service: str  # what predicts now
    pushes: int  # learned from
    errors: tuple[LearnedCurve, ...]  # [m], of predictions before learning
    parameters: tuple[LearnedCurve, ...]  # of the believed physics
    events: tuple[tuple[int, str, str], ...]  # number of pushes, kind and text of each


def decode_learning(message: Any) -> Learned:
    """Return what a ``Learning`` says; raises `InvalidInputError`: a curve with uneven columns."""
    return Learned(
        str(message.laboratory),
        str(message.service),
        int(message.pushes),
        tuple(map(_decode_curve, message.errors)),
        tuple(map(_decode_curve, message.parameters)),
        tuple((int(one.pushes), str(one.kind), str(one.text)) for one in message.events),
    )


def _decode_curve(message: Any) -> LearnedCurve:
    pushes = np.array(message.pushes, np.int64)
    columns = [np.array(getattr(message, name), np.float64) for name in ("value", "low", "high")]
    if any(len(column) != len(pushes) for column in columns) or len(pushes) > MOST_PLACES:
        sizes = [len(pushes), *map(len, columns)]
        raise InvalidInputError(
            f"curve {message.name!r} has columns of {sizes} places; allowed: the same number, up to"
            f" {MOST_PLACES}"
        )
    values = np.stack(columns, axis=1)
    return LearnedCurve(str(message.name), str(message.unit), pushes, values)
