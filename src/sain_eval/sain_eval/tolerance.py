"""How near a goal counts as reached. Imports nothing of this package."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

from sain_core.goal import TURN_PER_METRE, Goal


@dataclass(frozen=True, order=True)
class Tolerance:
    """A distance and a turn that count as success.

    Attributes:
        distance: [m], of places.
        given_turn: [rad], of headings; None: `TURN_PER_METRE` times the distance.
    """

    distance: float
    given_turn: float | None = None

    @classmethod
    def of(cls, value: "Tolerance | float") -> "Tolerance":
        """Return a tolerance; a number is its distance [m]."""
        return value if isinstance(value, Tolerance) else cls(value)

    @classmethod
    def parse(cls, word: str) -> Self:
        """Return the tolerance that ``METRES`` or ``METRES:RADIANS`` stands for.

        Raises:
            ValueError: it is neither.
        """
        distance, separator, turn = word.partition(":")
        return cls(float(distance), float(turn) if separator else None)

    @property
    def turn(self) -> float:
        """The turn [rad]."""
        return TURN_PER_METRE * self.distance if self.given_turn is None else self.given_turn

    def apply(self, goal: Goal) -> Goal:
        """Return a goal with this tolerance."""
        return goal.within(self.distance, self.turn)

    def stored(self) -> float | tuple[float, float]:
        """Return the numbers that were given."""
        return self.distance if self.given_turn is None else (self.distance, self.given_turn)


def tightest(tolerances: Iterable[Tolerance | float]) -> Tolerance:
    """Return the smallest distance with the smallest turn: what an episode is played to."""
    known = [Tolerance.of(tolerance) for tolerance in tolerances]
    return Tolerance(min(t.distance for t in known), min(t.turn for t in known))
