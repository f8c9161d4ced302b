"""Which of two predictors errs less: a test that stays valid when it is looked at after each push.

A gambler bets on each push, before it, that the first errs less. With errors a and b, the score of
a push is s = (b - a) / (a + b + m), where m is the median of earlier a + b: between -1 and 1, in
proportion to the difference where errors are usual, and bounded where one is huge. The wealth is
the product of 1 + bet * s. Where the first is not better, no rule of bets makes it grow: it ever
reaches W with a probability of at most 1 / W (Ville 1939; Waudby-Smith and Ramdas 2024).
"""

from collections import deque
from dataclasses import dataclass, field
from typing import Final

import numpy as np

CERTAIN: Final = 20.0  # wealth: at most 5 % of candidates that are no better ever reach it
MOST_BET: Final = 0.9
SCALE: Final = 100  # pushes that the median is of
LEAST: Final = 0.05  # [mm], of the median: smaller errors do not matter


@dataclass
class Bet:
    """The wealth of who bets that one predictor errs less than another.

    Attributes:
        resets: whether the wealth is never below 1, so that a change is noticed soon. It then
            reaches W by chance once in W pushes or less often.
        wealth: now.
        pushes: since the start.
    """

    resets: bool = False
    wealth: float = 1.0
    pushes: int = 0
    _sum: float = 0.0
    _squares: float = 1.0
    _sizes: deque[float] = field(default_factory=lambda: deque(maxlen=SCALE))

    def update(self, first: float, second: float) -> float:
        """Take the errors [mm] of both on one push; return the wealth after it."""
        both = first + second
        median = float(np.median(self._sizes)) if self._sizes else both
        score = (second - first) / (both + max(median, LEAST))
        bet = min(max(self._sum / self._squares, 0.0), MOST_BET)
        start = max(self.wealth, 1.0) if self.resets else self.wealth
        self.wealth = start * (1.0 + bet * score)
        self._sum += score
        self._squares += score**2
        self._sizes.append(both)
        self.pushes += 1
        return self.wealth

    @property
    def is_certain(self) -> bool:
        """Whether the first errs less beyond chance."""
        return self.wealth >= CERTAIN
