"""What is kept of an episode: arrays only, however it was run (closed loop, graph, bag)."""

from dataclasses import dataclass
from functools import cached_property

from jaxtyping import Float
from numpy import ndarray

from sain_core.push_record import PushRecord
from sain_core.scene import POSITION, Table, is_settled, target_distance
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene
from sain_eval.tolerance import Tolerance
from sain_mppi.search.poses import PoseGoal


@dataclass(frozen=True)
class EpisodeRecord:
    """The pushes of an episode towards a goal."""

    goal: Float[ndarray, "2"] | PoseGoal
    tolerance: float  # [m], of a goal (2,); poses have their own
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

    @property
    def wanted(self) -> tuple[int, ...]:
        """The bodies that the goal is about."""
        if isinstance(self.goal, PoseGoal):
            return tuple(pose.body for pose in self.goal.poses)
        return (1,)

    @cached_property
    def has_heading(self) -> bool:
        """Whether the goal asks for a heading."""
        return isinstance(self.goal, PoseGoal) and any(
            pose.heading is not None for pose in self.goal.poses
        )

    def left(self, scene: Scene) -> tuple[float, float]:
        """Return the largest distance [m] and turn [rad] of bodies to the goal in a scene."""
        if not isinstance(self.goal, PoseGoal):
            return float(target_distance(scene, self.goal)), 0.0
        apart, turns = self.goal.errors(scene, self.bodies)
        return float(apart.max()), float(abs(turns).max())

    def is_reached(self, scene: Scene, tolerance: Tolerance | float | None = None) -> bool:
        """Tell whether a scene (N, 8) fulfils the goal, at rest, within a tolerance or its own."""
        if not isinstance(self.goal, PoseGoal):
            within = self.tolerance if tolerance is None else Tolerance.of(tolerance).distance
            return bool(target_distance(scene, self.goal) <= within and is_settled(scene))
        goal = self.goal if tolerance is None else Tolerance.of(tolerance).of_poses(self.goal)
        return goal.reached(scene, self.scenes[0], self.bodies)

    def pushes_to(
        self, tolerance: Tolerance | float | None = None, table: Table = Table()
    ) -> int | None:
        """Return after how many pushes the goal was first reached within a tolerance, if ever.

        The scene must be settled then, with every body on the table.
        """
        for count, scene in enumerate(self.scenes):
            on_table = table.contains(scene[:, POSITION]).all()
            if on_table and self.is_reached(scene, tolerance):
                return count
        return None

    @property
    def final_distance(self) -> float:
        """Largest distance [m] of a body to its goal in the last scene."""
        return self.left(self.scenes[-1])[0]

    @property
    def final_turn(self) -> float:
        """Largest turn [rad] of a body to its goal in the last scene."""
        return self.left(self.scenes[-1])[1]
