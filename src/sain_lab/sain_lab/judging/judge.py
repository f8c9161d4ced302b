"""Who predicts best: the contenders of a laboratory, and which of them is in service.

Decisions follow from the errors on pushes that no contender had learned from, in the order of time,
by bets that stay valid when they are looked at after each push (`sain_lab.judging.betting`).
"""

from collections.abc import Iterator, Mapping
from typing import Any

from sain_lab.judging.betting import Bet
from sain_lab.keeping.laboratory import PHYSICS, PLANAR

Decision = tuple[str, str, dict[str, Any]]  # kind and text of an event, and more about it


class Judge:
    """Keeps the bets between contenders."""

    def __init__(self) -> None:
        """Begin with the physics in service."""
        self.service: str = PHYSICS
        self.candidate = ""
        self.worse: Bet = Bet(resets=True)  # that the one in service errs more than physics
        self.fallback: Bet = Bet(resets=True)  # that planar errs less than the physics
        self.better: dict[str, Bet] = {}  # that the candidate errs less than these

    @property
    def contenders(self) -> tuple[str, ...]:
        """The names of all that predict each push."""
        return tuple(dict.fromkeys(filter(None, (PLANAR, PHYSICS, self.service, self.candidate))))

    def update(self, errors: Mapping[str, float]) -> None:
        """Take the errors [mm] on a push."""
        physics = errors.get(PHYSICS)
        if physics is None:
            return
        if PLANAR in errors:
            first, second = (PLANAR, PHYSICS) if self.service != PLANAR else (PHYSICS, PLANAR)
            self.fallback.update(errors[first], errors[second])
        if self.service in errors and self.service not in (PHYSICS, PLANAR):
            self.worse.update(physics, errors[self.service])
        if self.candidate in errors:
            for other in (PHYSICS, self.service):
                if other in errors:
                    bet = self.better.setdefault(other, Bet())
                    bet.update(errors[self.candidate], errors[other])

    def decide(self) -> Iterator[Decision]:
        """Yield what follows now; each is to be taken before the next."""
        service = self.service
        if service not in (PHYSICS, PLANAR) and self.worse.is_certain:
            yield "dropped", f"{service} errs more than physics", {"service": PHYSICS}
        elif service == PHYSICS and self.fallback.is_certain:
            yield "dropped", "the believed physics errs more than planar", {"service": PLANAR}
        elif service == PLANAR and self.fallback.is_certain:
            yield "loaded", "the believed physics errs less than planar", {"service": PHYSICS}
        elif self.candidate and all(bet.is_certain for bet in self.better.values()) and self.better:
            text = f"{self.candidate} errs less than {' and '.join(self.better)}"
            yield "loaded", text, {"service": self.candidate}

    def take(self, record: Mapping[str, Any]) -> None:
        """Take an event of the log."""
        kind, about = record["event"], record["about"]
        if kind == "trained":
            self.candidate, self.better = about["model"], {}
        elif kind in ("loaded", "dropped"):
            if about["service"] == self.candidate:
                self.candidate = ""
            self.service, self.better = about["service"], {}
            self.worse, self.fallback = Bet(resets=True), Bet(resets=True)
