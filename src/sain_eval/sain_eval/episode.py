"""An episode as it is kept and judged, however it was played: closed loop, graph or recording."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

from sain_core.goal import TURN_PER_METRE, Goal, Judgement
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Scene
from sain_core.world import PushRecord


@dataclass(frozen=True, order=True)
class Tolerance:
    """A distance and a turn that count as success."""

    distance: float  # [m], of places
    given_turn: float | None = None  # [rad], of headings; None: `TURN_PER_METRE` times the distance

    @classmethod
    def of(cls, value: "Tolerance | float") -> "Tolerance":
        """Return a tolerance; a number is its distance [m]."""
        return value if isinstance(value, Tolerance) else cls(value)

    @classmethod
    def parse(cls, word: str) -> Self:
        """Return the tolerance that ``METRES`` or ``METRES:RADIANS`` stands for.

        Raises `ValueError`: it is neither.
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
    given = [Tolerance.of(tolerance) for tolerance in tolerances]
    return Tolerance(min(t.distance for t in given), min(t.turn for t in given))


@dataclass(frozen=True)
class EpisodeRecord:
    """The pushes of an episode towards a goal, which was given in the scene `start` (N, 8)."""

    goal: Goal
    pushes: tuple[PushRecord, ...]
    start: Scene
    bodies: Bodies = PAPER_DISKS
    title: str = ""

    def __post_init__(self) -> None:
        """Take as many of the paper's disks as there are bodies."""
        object.__setattr__(self, "bodies", self.bodies.fitted(len(self.start)))

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """All settled scenes, from the first to the last."""
        return (self.start, *(push.after for push in self.pushes))

    @property
    def last(self) -> Judgement:
        """The judgement of the last scene."""
        return self.judge(self.scenes[-1])

    def judge(self, scene: Scene, tolerance: Tolerance | float | None = None) -> Judgement:
        """Judge a scene (N, 8) within a tolerance, or that of the goal."""
        goal = self.goal if tolerance is None else Tolerance.of(tolerance).apply(self.goal)
        return goal.judge(scene, self.start, self.bodies)

    def pushes_to(self, tolerance: Tolerance | float | None = None) -> int | None:
        """Return after how many pushes the goal was first reached within a tolerance, if ever."""
        for count, scene in enumerate(self.scenes):
            if self.judge(scene, tolerance).reached:
                return count
        return None
