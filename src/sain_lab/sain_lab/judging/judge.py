"""Who predicts best: the contenders of a laboratory, and which of them is in service.

Each push is predicted by all of them before anything is learned from it. What counts is how much
they erred, older pushes less (prequential selection; Dawid 1984). Another contender comes into
service when it has erred less beyond chance: by `CERTAIN` standard errors of the difference, over
`FEWEST` pushes or more. The others stay contenders: the shipped model and planar physics for ever,
a network until the next one is trained.

A network corrects the physics that is believed. So it counts as having erred as much as that before
it was trained, and is judged first on the pushes that came during its training.
"""

from collections import deque
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from sain_lab.storage.laboratory import NETWORK, PHYSICS, PLANAR, SHIPPED
from sain_lab.storage.log import DROPPED, LEFT_OUT, LOADED, TRAINED

Decision = tuple[str, str, dict[str, Any]]  # kind and text of an event, and more about it

FADING: Final = 0.98  # what a push counts, of what the next one counts
KEPT: Final = 200  # pushes
MOST: Final = 3.0  # medians of the errors of planar physics: larger errors count as this one
CERTAIN: Final = 2.0  # standard errors
FEWEST: Final = 20  # pushes that two contenders predict differently


class Judge:
    """Keeps what the contenders erred.

    Attributes:
        service: the contender in service.
        candidate: the latest network that is not in service; empty: there is none.
    """

    def __init__(self) -> None:
        self.service: str = PHYSICS
        self.candidate = ""
        self._rows: deque[dict[str, float]] = deque(maxlen=KEPT)  # errors [mm] by contender

    @property
    def contenders(self) -> tuple[str, ...]:
        """The names of all that predict each push."""
        names = PLANAR, PHYSICS, SHIPPED, self.service, self.candidate
        return tuple(dict.fromkeys(filter(None, names)))

    def update(self, errors: Mapping[str, float]) -> None:
        """Take the errors [mm] on a push."""
        self._rows.append(dict(errors))

    def lead(self, name: str) -> float:
        """Return by how many standard errors a contender has erred less than what is in service."""
        planar = [row[PLANAR] for row in self._rows if PLANAR in row]
        most, gains = MOST * float(np.median(planar or [np.inf])), []
        for age, row in enumerate(reversed(self._rows)):
            first, second = (self._error(row, one) for one in (name, self.service))
            if first is not None and second is not None and first != second:
                gains.append(FADING**age * (min(second, most) - min(first, most)))
        if len(gains) < FEWEST:
            return 0.0
        return float(np.sum(gains) / max(np.linalg.norm(gains), 1e-9))

    def _error(self, row: Mapping[str, float], name: str) -> float | None:
        if name == PHYSICS and row.get(PHYSICS) == row.get(SHIPPED):
            return None  # there was no belief yet
        return row.get(name, row.get(PHYSICS) if NETWORK.fullmatch(name) else None)

    def decide(self) -> Decision | None:
        """Return what follows now; None: nothing. It counts once `take` has it."""
        others = [name for name in self.contenders if name != self.service]
        best = max(others, key=self.lead)
        if self.lead(best) < CERTAIN:
            return None
        return LOADED, f"{best} errs less than {self.service}", {"service": best}

    def take(self, record: Mapping[str, Any]) -> None:
        """Take an event of the log."""
        kind, about = record["event"], record["about"]
        if kind == TRAINED:
            self.candidate = about["model"]
            unseen = reversed(about["unseen"])
            for row, error in zip(reversed(self._rows), unseen, strict=False):
                if error is not None:
                    row[self.candidate] = error
        elif kind == LEFT_OUT and about["model"] == self.candidate:
            self.candidate = ""
        elif kind in (LOADED, DROPPED):
            self._change_service(kind, about["service"])

    def _change_service(self, kind: str, service: str) -> None:
        before, self.service = self.service, service
        if service == self.candidate:
            self.candidate = ""
        if kind == LOADED and NETWORK.fullmatch(before) and not self.candidate:
            self.candidate = before
