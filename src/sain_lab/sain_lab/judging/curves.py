"""What a laboratory shows: errors against the number of pushes, parameters, and events."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.randomness import Interval, bootstrap_mean, generator
from sain_lab.storage.laboratory import PHYSICS, PLANAR, Laboratory, check_record
from sain_lab.storage.log import Event, LogReader, Record

SERVICE: Final = "in service"
WINDOW: Final = 50  # pushes of a running mean
SCENES: Final = {"before", "push", "after", "noise", "digest"}  # what no curve needs of a record


@dataclass(frozen=True, eq=False)
class Curves:
    """What was logged of M pushes."""

    # mean errors [mm] by contender (M,); NaN where it did not predict. "in service" is whatever was
    # in service then
    errors: dict[str, Float[ndarray, "M"]]
    # by name, arrays (C, 3): number of pushes, value, spread (of the logarithm, if it is a factor)
    parameters: dict[str, Float[ndarray, "C 3"]]
    events: tuple[Event, ...]  # in order

    @property
    def pushes(self) -> int:
        """The number of pushes M."""
        return len(self.errors[SERVICE])

    def interval(self, name: str, first: int, last: int) -> Interval:
        """Return the mean error over pushes first to last with its 95 % interval."""
        values = self.errors[name][first:last]
        return bootstrap_mean(values[np.isfinite(values)], generator(0, "curve"))


class CurveReader:
    """The curves of a laboratory in which somebody learns."""

    def __init__(self, laboratory: Laboratory) -> None:
        self._log = LogReader(laboratory.log_path, check_record)
        self._records: list[Record] = []  # without scenes

    def read(self) -> Curves:
        """Return the curves as they are now; raises `DatasetError`."""
        for record in self._log.read():
            self._records.append({key: record[key] for key in record.keys() - SCENES})
        return curves_of(self._records)


def curves_of(records: Iterable[Record]) -> Curves:
    """Return the curves of the records of a log."""
    errors: list[dict[str, float]] = []
    events: list[Event] = []
    beliefs: list[tuple[int, dict[str, Any]]] = []
    service = PHYSICS
    for record in records:
        if record["kind"] == "push":
            found = record["errors"]
            errors.append(found | ({SERVICE: found[service]} if service in found else {}))
        elif record["kind"] == "belief":
            beliefs.append((record["pushes"], record["parameters"]))
        elif record["kind"] == "event":
            events.append(Event.of_record(record))
            service = record["about"].get("service", service)
    return Curves(_columns(errors), _parameters(beliefs), tuple(events))


def _columns(rows: list[dict[str, float]]) -> dict[str, ndarray]:
    names = dict.fromkeys([SERVICE, PHYSICS, PLANAR, *(name for row in rows for name in row)])
    return {name: np.array([row.get(name, np.nan) for row in rows], float) for name in names}


def _parameters(beliefs: list[tuple[int, dict[str, Any]]]) -> dict[str, ndarray]:
    names = dict.fromkeys(name for _, values in beliefs for name in values)
    return {
        name: np.array([(count, *values[name]) for count, values in beliefs if name in values])
        for name in names
    }


def running(
    values: Float[ndarray, "M"], window: int = WINDOW
) -> tuple[Float[ndarray, "M"], Float[ndarray, "M"]]:
    """Return means of the latest values, so many at most, and half of their 95 % intervals.

    One value has no interval: NaN.
    """
    known = np.isfinite(values)
    filled = np.where(known, values, 0.0)

    def sums(some: ndarray) -> ndarray:
        total = np.concatenate([[0.0], np.cumsum(some)])
        ends = np.arange(1, len(some) + 1)
        return np.asarray(total[ends] - total[np.maximum(ends - window, 0)])

    with np.errstate(divide="ignore", invalid="ignore"):
        count, mean = sums(known), sums(filled) / sums(known)
        variance = np.maximum(sums(filled**2) / count - mean**2, 0.0)
        return mean, 1.96 * np.sqrt(variance / np.where(count > 1.0, count - 1.0, np.nan))
