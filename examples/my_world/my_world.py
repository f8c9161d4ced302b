"""A world of disks without inertia, and without friction at rims: each gives way, and stops.

It is quasi-static: the tool moves by half a millimetre, and all that overlaps makes room, by as
little as possible. Of two disks the lighter one gives way more.
"""

import numpy as np

from sain_core.errors import InvalidInputError
from sain_core.push import LENGTH, PushLimits, strokes
from sain_core.scene import MASS, POSITION, RADIUS, VELOCITY, unit
from sain_core.world import Outcome, Setting

STEP = 5e-4  # [m], of the tool
SWEEPS = 50  # over all contacts, in a step
TOUCHING = 1e-7  # [m]: a smaller overlap is none


class MyWorld:
    """Executes pushes of disks."""

    def reset(self, start: Setting) -> np.ndarray:
        """Begin an episode; return its first scene (N, 8).

        Raises:
            InvalidInputError: bodies that are no disks, or that are fixed.
        """
        if not start.bodies.all_round or start.bodies.fixed:
            raise InvalidInputError("my_world has disks that move, and nothing else")
        self._bodies, self._scene = start.bodies, start.scene.copy()
        self._scene[:, VELOCITY] = 0.0
        return self.observe()

    def observe(self) -> np.ndarray:
        """Return the scene (N, 8) as it is."""
        return self._scene.copy()

    def push(self, push: np.ndarray, *, seen: np.ndarray | None = None) -> Outcome:
        """Execute a push."""
        before, limits = self.observe(), PushLimits()
        planned_from = before if seen is None else seen
        start, heading = strokes(planned_from, push, limits, self._bodies)
        for way in np.linspace(0.0, push[LENGTH], 1 + int(np.ceil(push[LENGTH] / STEP))):
            self._make_room(start + way * unit(heading), limits.tool_radius)
        return Outcome(before, self.observe())

    def _make_room(self, tool: np.ndarray, tool_radius: float) -> None:
        """Move disks until none overlaps the tool (2,) [m] or another disk."""
        for _ in range(SWEEPS):
            moved = 0.0
            for body, state in enumerate(self._scene):
                away = state[POSITION] - tool
                overlap = state[RADIUS] + tool_radius - np.linalg.norm(away)
                if overlap > TOUCHING:
                    state[POSITION] += overlap * _direction(away)
                    moved = max(moved, overlap)
                for other in self._scene[body + 1 :]:
                    moved = max(moved, _part(state, other))
            if moved <= TOUCHING:
                return


def _part(one: np.ndarray, other: np.ndarray) -> float:
    """Move two disks (8,) apart; return by how much they overlapped [m]."""
    away = other[POSITION] - one[POSITION]
    overlap = float(one[RADIUS] + other[RADIUS] - np.linalg.norm(away))
    if overlap > TOUCHING:
        share = other[MASS] / (one[MASS] + other[MASS])
        one[POSITION] -= share * overlap * _direction(away)
        other[POSITION] += (1.0 - share) * overlap * _direction(away)
    return overlap


def _direction(way: np.ndarray) -> np.ndarray:
    return way / max(float(np.linalg.norm(way)), 1e-12)


def load(name: str) -> MyWorld:
    """Return a world; the entry point in `pyproject.toml` leads here."""
    return MyWorld()
