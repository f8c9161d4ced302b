"""Who predicts best: the contenders of a laboratory, and which of them is in service.

Decisions follow from the errors on pushes that no contender had learned from, in the order of time,
by bets that stay valid when they are looked at after each push (`sain_lab.judging.judge`).

Two challengers may replace what is in service: the shipped model, from the first push on, and the
latest network of the laboratory. A network is also judged on the pushes that came while it was
trained.

Which of two predictors errs less: a test that stays valid when it is looked at after each push.

A gambler bets on each push, before it, that the first errs less. With errors a and b, the score of
a push is s = (b - a) / (|b - a| + 3 m), from -1 to 1, where m is the median of earlier differences
|b - a|, or that of earlier errors a if it is smaller. So a small difference that comes again and
again counts, and one huge error does not decide alone. The wealth is the product of 1 + bet * s.
Where the first is not better, no rule of bets makes it grow: it ever reaches W with a probability
of at most 1 / W (Ville 1939; Waudby-Smith and Ramdas 2024). What errs less often and, in sum, more
is not certain either.
"""

from collections import deque
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from sain_lab.keeping.laboratory import PHYSICS, PLANAR, SHIPPED
from sain_lab.keeping.log import CHANGED, DROPPED, FAILED, LEFT_OUT, LOADED, TRAINED, TRAINING

CERTAIN: Final = 20.0  # wealth: at most 5 % of candidates that are no better ever reach it
ALARM: Final = 30.0  # likewise of a bet that resets: by chance once in 30 pushes at worst
GROWN: Final = 2.0  # a wealth that is no longer small
BETS: Final = np.array([0.2, 0.5, 0.9])  # a third of the first money each
DAMPING: Final = 3.0  # medians: a difference as large as one scores a quarter
SCALE: Final = 100  # pushes that medians are of
LEAST: Final = 0.01  # [mm], of a median: smaller differences do not matter


class Bet:
    """The wealth of who bets that one predictor errs less than another.

    Attributes:
        resets: whether the wealth is never below 1 before a push, so that a change is noticed soon.
        worth: share of the usual error below which a difference matters little.
        pushes: since the start.
        growing: pushes since it was small: the first has been better for about as long.
    """

    def __init__(
        self, resets: bool = False, wealth: float = 1.0, alarm: float = ALARM, worth: float = 0.0
    ) -> None:
        self.resets, self.worth, self.pushes = resets, worth, 0
        self._enough = alarm if resets else CERTAIN
        self.growing = 0
        self._wealths = np.full(len(BETS), wealth)
        self._differences: deque[float] = deque(maxlen=SCALE)
        self._errors: deque[float] = deque(maxlen=SCALE)
        self._gain = 0.0  # sum of the differences [mm]

    def heir(self) -> "Bet":
        """Return the bet on the successor of the first: made the same way, from more pushes.

        What was won goes on, so that a way of making predictors is judged; losses do not.
        """
        heir = Bet(self.resets, max(self.wealth, 1.0), self._enough, self.worth)
        heir._differences, heir._errors = self._differences.copy(), self._errors.copy()
        heir._gain = max(self._gain, 0.0)
        return heir

    @property
    def wealth(self) -> float:
        """The wealth now."""
        return float(self._wealths.mean())

    def update(self, first: float, second: float) -> float:
        """Take the errors [mm] of both on one push; return the wealth after it."""
        gain = second - first
        usual = abs(gain)
        if self._differences:
            error = float(np.median(self._errors))
            usual = max(min(float(np.median(self._differences)), error), self.worth * error)
        usual = max(usual, LEAST)
        score = gain / (abs(gain) + DAMPING * usual)
        start = np.maximum(self._wealths, 1.0) if self.resets else self._wealths
        self._wealths = start * (1.0 + BETS * score)
        self.growing = self.growing + 1 if self.wealth > GROWN else 0
        self._differences.append(abs(gain))
        self._errors.append(first)
        self._gain += gain
        self.pushes += 1
        return self.wealth

    @property
    def is_certain(self) -> bool:
        """Whether the first errs less beyond chance."""
        return self.wealth >= self._enough and (self.resets or self._gain > 0.0)


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
            self._begin_candidate(about["model"], about.get("unseen", ()))
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
