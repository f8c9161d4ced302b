"""How sure the poses of bodies are, and with what probability a goal is reached."""

from dataclasses import dataclass
from math import erf, sqrt
from typing import Final

import numpy as np

from sain_core.errors import OutOfRangeError
from sain_core.goal import Goal, Judgement
from sain_core.types import Scalars

POINTS: Final = 201  # of the integral of a probability


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """How sure the poses of N bodies are: standard deviations of normal errors.

    Attributes:
        places: (N,) [m], of each coordinate.
        turns: (N,) [rad].
        confidence: least probability with which a goal counts as reached.
    """

    places: Scalars
    turns: Scalars
    confidence: float

    def within(self, body: int, distance: float, tolerance: float) -> float:
        """Return the probability that a body, seen so far from a place, is within a tolerance [m].

        With normal errors of both coordinates, along and across the line to the place.
        """
        std = float(self.places[body])
        if std == 0.0:
            return float(distance <= tolerance)
        along = np.linspace(-tolerance, tolerance, POINTS)
        density = np.exp(-0.5 * ((along - distance) / std) ** 2) / (std * sqrt(2.0 * np.pi))
        across = np.sqrt(np.maximum(tolerance**2 - along**2, 0.0)) / (std * sqrt(2.0))
        return float(np.trapezoid(density * [erf(a) for a in across.tolist()], along))

    def turned_within(self, body: int, turn: float, tolerance: float) -> float:
        """Return the probability that a body's heading, seen so far off, is within a tolerance."""
        std = float(self.turns[body])
        if std == 0.0:
            return float(abs(turn) <= tolerance)
        high, low = ((end - turn) / (std * sqrt(2.0)) for end in (tolerance, -tolerance))
        return 0.5 * (erf(high) - erf(low))

    def reached(self, judged: Judgement) -> float:
        """Return the probability that all poses of a goal are met within their tolerances."""
        probability = 1.0
        for pose, distance, turn in zip(
            judged.goal.poses, judged.distances, judged.turns, strict=True
        ):
            probability *= self.within(pose.body, float(distance), pose.tolerance)
            if pose.heading is not None:
                probability *= self.turned_within(pose.body, float(turn), pose.heading_tolerance)
        return probability

    def check_tolerance(self, goal: Goal) -> None:
        """Check that a goal counts as reached where the bodies are seen exactly at it.

        Raises:
            OutOfRangeError: its tolerances are too small for that.
        """
        nothing = np.zeros(len(goal.poses))
        there = Judgement(goal, nothing, nothing, np.zeros(0), at_rest=True, on_table=True)
        if self.reached(there) < self.confidence:
            raise OutOfRangeError(
                "the tolerances are too small for what is observed: poses have standard deviations"
                f" of {1e3 * self.places.max():.1f} mm and {self.turns.max():.3f} rad, and bodies"
                f" seen at the goal are within them with less than {100 * self.confidence:g} %;"
                " choose wider tolerances, or a smaller estimator.precision or"
                " estimator.confidence"
            )
