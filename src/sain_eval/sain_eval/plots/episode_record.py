"""What is kept of an episode: arrays only, however it was run (closed loop, graph, bag)."""

from dataclasses import dataclass
from functools import cached_property

from sain_core.goal import Goal, Judgement
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene
from sain_core.world import PushRecord
from sain_eval.tolerance import Tolerance


@dataclass(frozen=True)
class EpisodeRecord:
    """The pushes of an episode towards a goal."""

    goal: Goal
    pushes: tuple[PushRecord, ...]
    start: Scene  # (N, 8)
    shapes: tuple[str, ...] = ()  # the name of each body's shape; empty: all disks
    title: str = ""
    roles: tuple[str, ...] = ()  # of each body; empty: the paper's

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """All settled scenes, from the first to the last."""
        return (self.start, *(push.after for push in self.pushes))

    @cached_property
    def bodies(self) -> Bodies:
        """Shape and role of each body."""
        count = len(self.scenes[0])
        return Bodies.named(self.shapes or ("disk",) * count, self.roles)

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

    @property
    def last(self) -> Judgement:
        """The judgement of the last scene."""
        return self.judge(self.scenes[-1])
