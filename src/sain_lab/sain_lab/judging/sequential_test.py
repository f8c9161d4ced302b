"""Which of two predictors errs less: a test that stays valid when it is looked at after each push.

A gambler bets on each push, before it, that the first errs less. With errors a and b, the score of
a push is s = (b - a) / (|b - a| + 3 m), from -1 to 1, where m is the median of earlier differences
|b - a|, or that of earlier errors a if it is smaller. So a small difference that comes again and
again counts, and one huge error does not decide alone. The wealth is the product of 1 + bet * s.
Where the first is not better, no rule of bets makes it grow: it ever reaches W with a probability
of at most 1 / W (Ville 1939; Waudby-Smith and Ramdas 2024). What errs less often and, in sum, more
is not certain either.
"""

from collections import deque
from typing import Final

import numpy as np

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
