"""Who predicts best: the contenders of a laboratory, and which of them is in service.

Decisions follow from the errors on pushes that no contender had learned from, in the order of time,
by bets that stay valid when looked at after each push (`sain_lab.judging.sequential_test`).

Two challengers may replace what is in service: the shipped model, from the first push on, and the
latest network of the laboratory. A network is also judged on the pushes that came while it was
trained.
"""

from collections.abc import Mapping
from typing import Any, Final

from sain_lab.judging.sequential_test import Bet
from sain_lab.storage.laboratory import PHYSICS, PLANAR, SHIPPED
from sain_lab.storage.log import CHANGED, DROPPED, FAILED, LEFT_OUT, LOADED, TRAINED, TRAINING

Decision = tuple[str, str, dict[str, Any]]  # kind and text of an event, and more about it
Bets = dict[str, Bet]  # that a challenger errs less than these


RECENT: Final = "recent"  # physics by the latest pushes alone: it notices a change
WORTH: Final = 0.5  # share of the error: a smaller gain is no change of the table
SUSPECTED: Final = 20.0  # wealth: to begin anew from what is believed costs little


class Judge:
    """Keeps the bets between contenders."""

    def __init__(self) -> None:
        self.service: str = PHYSICS
        self.candidate = ""
        self._unseen: list[Mapping[str, float]] = []  # errors on pushes during a training
        self._trains = False
        self._begin()
        self.changed = _of_change()

    def _begin(self) -> None:
        self.worse = Bet(resets=True)  # that physics errs less than what else is in service
        self.fallback = Bet(resets=True)  # that the other of physics and planar errs less
        self.better: Bets = {}  # of the candidate
        self.of_shipped: Bets = {}

    @property
    def _others(self) -> tuple[str, ...]:
        """What a challenger has to be better than."""
        return tuple(dict.fromkeys((PHYSICS, self.service)))

    @property
    def _challengers(self) -> dict[str, Bets]:
        bets = {SHIPPED: self.of_shipped, self.candidate: self.better}
        return {name: some for name, some in bets.items() if name not in ("", self.service)}

    @property
    def contenders(self) -> tuple[str, ...]:
        """The names of all that predict each push."""
        names = PLANAR, PHYSICS, RECENT, SHIPPED, self.service, self.candidate
        return tuple(dict.fromkeys(filter(None, names)))

    def update(self, errors: Mapping[str, float]) -> None:
        """Take the errors [mm] on a push."""
        if self._trains:
            self._unseen.append(errors)
        physics = errors.get(PHYSICS)
        if physics is None:
            return
        if RECENT in errors:
            self.changed.update(errors[RECENT], physics)
        if PLANAR in errors:
            pair = errors[PLANAR], physics
            self.fallback.update(*(pair[::-1] if self.service == PLANAR else pair))
        if self.service not in (PHYSICS, PLANAR) and self.service in errors:
            self.worse.update(physics, errors[self.service])
        for name, bets in self._challengers.items():
            self._bet(name, bets, errors)

    def _bet(self, name: str, bets: Bets, errors: Mapping[str, float]) -> None:
        for other in self._others if name in errors else ():
            if other in errors:
                bets.setdefault(other, Bet()).update(errors[name], errors[other])

    def decide(self) -> Decision | None:
        """Return what follows now; None: nothing. It counts once `take` has it."""
        if self.changed.is_certain:
            text = "the latest pushes contradict what is believed: older pushes are left out"
            return CHANGED, text, {"service": PHYSICS, "keep": self.changed.growing}
        if self.service not in (PHYSICS, PLANAR) and self.worse.is_certain:
            return DROPPED, f"{self.service} errs more than physics", {"service": PHYSICS}
        if self.fallback.is_certain and self.service == PHYSICS:
            text = "the believed physics errs more than planar"
            return DROPPED, text, {"service": PLANAR}
        if self.fallback.is_certain and self.service == PLANAR:
            text = "the believed physics errs less than planar"
            return LOADED, text, {"service": PHYSICS}
        for name, all_bets in self._challengers.items():
            bets = [all_bets[other] for other in self._others if other in all_bets]
            if bets and all(bet.is_certain for bet in bets):
                text = f"{name} errs less than {' and '.join(self._others)}"
                return LOADED, text, {"service": name}
        return None

    def take(self, record: Mapping[str, Any]) -> None:
        """Take an event of the log."""
        kind, about = record["event"], record["about"]
        if kind in (TRAINING, FAILED):
            self._trains, self._unseen = kind == TRAINING, []
        elif kind == TRAINED:
            self._begin_candidate(about["model"], about["unseen"])
        elif kind == LEFT_OUT and about["model"] == self.candidate:
            self.candidate = ""
        elif kind in (LOADED, DROPPED, CHANGED):
            self._change_service(kind, about["service"])

    def _begin_candidate(self, name: str, unseen: list[float | None]) -> None:
        """Judge a new network, first on the pushes that came while it was trained."""
        self.candidate = name
        self.better = {other: bet.heir() for other, bet in self.better.items()}
        for errors, error in zip(self._unseen, unseen, strict=False):
            if error is not None:
                self._bet(name, self.better, {**errors, name: error})
        self._trains, self._unseen = False, []

    def _change_service(self, kind: str, service: str) -> None:
        if service == self.candidate or kind == CHANGED:
            self.candidate = ""
        self.service, proven = service, self.better.get(PHYSICS)
        self._begin()
        if kind == LOADED and proven is not None:
            self.better[PHYSICS] = proven.heir()
        if kind == CHANGED:
            self.changed = _of_change()


def _of_change() -> Bet:
    """Return the bet that the latest pushes alone predict much better."""
    return Bet(resets=True, alarm=SUSPECTED, worth=WORTH)
