"""The tool's way of a push, checked once."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import BlockedError, InvalidInputError, StaleSceneError
from sain_core.feasibility import Feasibility, place_gap
from sain_core.push import BODY, DEFAULT_SPEED, LENGTH, SPEED, PushLimits, strokes
from sain_core.scene import MID, check_on_table, check_states, unit
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import PushArray, Scene

RETREAT: Final = 0.01  # [m], room for errors of the places that bodies are taken to have


@dataclass(frozen=True)
class Stroke:
    """A straight line of the tool from start (2,) to end (2,) [m] in the world.

    Attributes:
        heading: of its travel [rad].
        speed: of its travel [m/s].
        body: the one that it pushes.
    """

    start: Float[ndarray, "2"]
    end: Float[ndarray, "2"]
    heading: float
    speed: float = DEFAULT_SPEED
    body: int = MID

    @classmethod
    def of_push(
        cls, scene: Scene, push: PushArray, limits: PushLimits, bodies: Bodies = PAPER_DISKS
    ) -> "Stroke":
        """Return the tool's way for a push (5,) in a scene (N, 8), of disks by default."""
        start, heading = strokes(scene, push, limits, bodies)
        end = start + push[LENGTH] * unit(heading)
        return cls(start, end, float(heading), float(push[SPEED]), int(push[BODY]))

    def from_further_back(self, way: float) -> "Stroke":
        """Return this stroke with a start that lies further back by a way [m]."""
        return replace(self, start=self.start - way * unit(np.asarray(self.heading)))

    @property
    def length(self) -> float:
        """The tool's travel [m]."""
        return float(np.linalg.norm(self.end - self.start))


def checked_stroke(
    push: PushArray,
    scene: Scene,
    settled: bool,
    feasibility: Feasibility,
    bodies: Bodies,
    seen: Float[ndarray, "M 8"] | None = None,
) -> Stroke:
    """Return the tool's way for a push that can be carried out in a scene (N, 8).

    Where the push was planned from a scene as `seen`, the way follows from that, and starts further
    back by `RETREAT`.

    Raises:
        InvalidInputError: wrong shape, NaN or Inf.
        OutOfRangeError: a value outside its range.
        OffTableError: a body has left the table.
        StaleSceneError: the bodies still move.
        UnreachableError: a way that leaves the reach.
        BlockedError: a body is in the tool's way.
    """
    limits = feasibility.limits
    limits.check(push, bodies)
    if seen is not None:
        check_states(seen)
        if len(seen) != len(scene):
            raise InvalidInputError(
                f"the push was planned for {len(seen)} bodies; this world has {len(scene)}"
            )
    planned_from = scene if seen is None else seen
    stroke = Stroke.of_push(planned_from, push, limits, bodies)
    check_on_table(scene, feasibility.table)
    if not settled:
        raise StaleSceneError("the disks still move; a push needs a settled scene")
    if push[LENGTH] == 0.0:
        return stroke
    way = unit(np.asarray(stroke.heading))
    feasibility.check_way(stroke.start, way, planned_from, push, bodies)
    return stroke if seen is None else _withdrawn(stroke, scene, feasibility, bodies)


def _withdrawn(stroke: Stroke, scene: Scene, feasibility: Feasibility, bodies: Bodies) -> Stroke:
    """Return a stroke that starts further back, for bodies that are seen elsewhere.

    Raises:
        BlockedError: the tool would be lowered into a body of the scene (N, 8) as it is.
    """
    withdrawn = stroke.from_further_back(RETREAT)
    gap = place_gap(scene, withdrawn.start, bodies) - feasibility.limits.tool_radius
    if gap < 0.0:
        raise BlockedError(
            f"the tool would be lowered {-1e3 * gap:.1f} mm into a body: it stands elsewhere than"
            " where the push takes it to be"
        )
    return withdrawn
