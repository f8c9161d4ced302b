"""Who predicts best: the contenders of a laboratory, and which of them is in service.

Decisions follow from the errors on pushes that no contender had learned from, in the order of time,
by bets that stay valid when they are looked at after each push (`sain_lab.judging.betting`).
"""

from collections.abc import Mapping
from typing import Any, Final

from sain_lab.judging.betting import Bet
from sain_lab.judging.events import CHANGED, DROPPED, LOADED, TRAINED
from sain_lab.keeping.laboratory import PHYSICS, PLANAR

Decision = tuple[str, str, dict[str, Any]]  # kind and text of an event, and more about it


RECENT: Final = "recent"  # physics by the latest pushes alone: it notices a change
WORTH: Final = 0.5  # share of the error: a smaller gain is no change of the table
SUSPECTED: Final = 20.0  # wealth: to begin anew from what is believed costs little


class Judge:
    """Keeps the bets between contenders."""

    def __init__(self) -> None:
        """Begin with the physics in service."""
        self.service: str = PHYSICS
        self.candidate = ""
        self._begin()
        self.changed = _of_change()

    def _begin(self) -> None:
        self.worse = Bet(resets=True)  # that physics errs less than the network in service
        self.fallback = Bet(resets=True)  # that the other of physics and planar errs less
        self.better: dict[str, Bet] = {}  # that the candidate errs less than these

    @property
    def has_network(self) -> bool:
        """Whether a network is in service."""
        return self.service not in (PHYSICS, PLANAR)

    @property
    def _others(self) -> tuple[str, ...]:
        """What a candidate has to be better than."""
        return tuple(dict.fromkeys((PHYSICS, self.service)))

    @property
    def contenders(self) -> tuple[str, ...]:
        """The names of all that predict each push."""
        names = PLANAR, PHYSICS, RECENT, self.service, self.candidate
        return tuple(dict.fromkeys(filter(None, names)))

    def update(self, errors: Mapping[str, float]) -> None:
        """Take the errors [mm] on a push."""
        physics = errors.get(PHYSICS)
        if physics is None:
            return
        if RECENT in errors:
            self.changed.update(errors[RECENT], physics)
        if PLANAR in errors:
            pair = errors[PLANAR], physics
            self.fallback.update(*(pair[::-1] if self.service == PLANAR else pair))
        if self.has_network and self.service in errors:
            self.worse.update(physics, errors[self.service])
        if self.candidate in errors:
            for other in self._others:
                if other in errors:
                    bet = self.better.setdefault(other, Bet())
                    bet.update(errors[self.candidate], errors[other])

    def decide(self) -> Decision | None:
        """Return what follows now; None: nothing. It counts once `take` has it."""
        if self.changed.is_certain:
            text = "the latest pushes contradict what is believed: older pushes are left out"
            return CHANGED, text, {"service": PHYSICS, "keep": self.changed.growing}
        if self.has_network and self.worse.is_certain:
            return DROPPED, f"{self.service} errs more than physics", {"service": PHYSICS}
        if self.fallback.is_certain and self.service == PHYSICS:
            text = "the believed physics errs more than planar"
            return DROPPED, text, {"service": PLANAR}
        if self.fallback.is_certain and self.service == PLANAR:
            text = "the believed physics errs less than planar"
            return LOADED, text, {"service": PHYSICS}
        bets = [self.better[name] for name in self._others if name in self.better]
        if self.candidate and bets and all(bet.is_certain for bet in bets):
            text = f"{self.candidate} errs less than {' and '.join(self._others)}"
            return LOADED, text, {"service": self.candidate}
        return None

    def take(self, record: Mapping[str, Any]) -> None:
        """Take an event of the log."""
        kind, about = record["event"], record["about"]
        if kind == TRAINED:
            self.candidate = about["model"]
            self.better = {name: bet.heir() for name, bet in self.better.items()}
        elif kind in (LOADED, DROPPED, CHANGED):
            if about["service"] == self.candidate or kind == CHANGED:
                self.candidate = ""
            self.service = about["service"]
            proven = self.better.get(PHYSICS)
            self._begin()
            if kind == LOADED and proven is not None:
                self.better[PHYSICS] = proven.heir()
            if kind == CHANGED:
                self.changed = _of_change()


def _of_change() -> Bet:
    """Return the bet that the latest pushes alone predict much better."""
    return Bet(resets=True, alarm=SUSPECTED, worth=WORTH)
