"""What a learner said last in a recording, as the page's script reads it."""

from collections import deque
from typing import Any, Final

from sain_bags.reading.reader import Bag
from sain_bags.report.pushes import rounded
from sain_core.errors import DatasetError, InvalidInputError
from sain_core.wire.learning import Learned, LearnedCurve, decode_learning

LEARNING: Final = "sain_interfaces/msg/Learning"


def describe_learning(bag: Bag) -> dict[str, Any] | None:
    """Return the curves and events of a learner; None: there was none.

    Raises:
        DatasetError: the message makes no sense.
    """
    latest = deque(bag.messages(types=(LEARNING,)), maxlen=1)
    for last in latest:
        try:
            return as_json(decode_learning(last.message))
        except InvalidInputError as error:
            raise DatasetError(f"{bag.path}: {last.topic}: {error}") from error
    return None


def as_json(learned: Learned) -> dict[str, Any]:
    """Return what was learned."""
    return {
        "laboratory": learned.laboratory,
        "service": learned.service,
        "pushes": learned.pushes,
        "errors": [_curve(one) for one in learned.errors],
        "parameters": [_curve(one) for one in learned.parameters],
        "events": [list(event) for event in learned.events],
    }


def _curve(curve: LearnedCurve) -> dict[str, Any]:
    rows = [[rounded(number, 6) for number in row] for row in curve.values.tolist()]
    return {"name": curve.name, "unit": curve.unit, "pushes": curve.pushes.tolist(), "rows": rows}
