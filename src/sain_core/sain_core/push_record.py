"""The record of one push: what was decided, what was expected and what was found."""

from dataclasses import dataclass

import numpy as np

from sain_core.scene import POSITION
from sain_core.types import PushArray, Scene


@dataclass(frozen=True)
class PushRecord:
    """One push that was carried out, however it was run (closed loop, graph, bag)."""

    push: PushArray  # (3,) or (4,)
    before: Scene  # (N, 8), settled
    predicted: Scene | None  # (N, 8), what the planner's model expected
    physics: Scene | None  # (N, 8), what the nominal world expected, f_p
    after: Scene  # (N, 8), settled
    planning_time: float = 0.0  # [s]

    def error(self, disk: int) -> float | None:
        """Return how far [m] the prediction put a disk from where it came to rest."""
        return _apart(self.predicted, self.after, disk)

    def physics_error(self, body: int) -> float | None:
        """Return how far [m] physics alone put a body from where it came to rest."""
        return _apart(self.physics, self.after, body)


def _apart(predicted: Scene | None, after: Scene, disk: int) -> float | None:
    if predicted is None:
        return None
    return float(np.linalg.norm(predicted[disk, POSITION] - after[disk, POSITION]))
