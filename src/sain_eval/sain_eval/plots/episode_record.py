"""What is kept of an episode: arrays only, however it was run (closed loop, graph, bag)."""

from dataclasses import dataclass

from jaxtyping import Float
from numpy import ndarray

from sain_core.push_record import PushRecord
from sain_core.scene import POSITION, Table, is_settled, target_distance
from sain_core.types import Scene


@dataclass(frozen=True)
class EpisodeRecord:
    """The pushes of an episode towards a goal."""

    goal: Float[ndarray, "2"]
    tolerance: float  # [m]
    pushes: tuple[PushRecord, ...]
    start: Scene  # (N, 8)
    shapes: tuple[str, ...] = ()  # the name of each disk's shape; empty: all disks
    title: str = ""

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """All settled scenes, from the first to the last."""
        return (self.start, *(push.after for push in self.pushes))

    def pushes_to(self, tolerance: float, table: Table = Table()) -> int | None:
        """Return after how many pushes the target first lay within tolerance [m], if ever.

        The scene must be settled then, with every disk on the table.
        """
        for count, scene in enumerate(self.scenes):
            near = target_distance(scene, self.goal) <= tolerance
            if near and is_settled(scene) and table.contains(scene[:, POSITION]).all():
                return count
        return None

    @property
    def final_distance(self) -> float:
        """Distance [m] from target to goal in the last scene."""
        return float(target_distance(self.scenes[-1], self.goal))
