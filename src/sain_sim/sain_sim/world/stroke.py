"""The tool's way of a push: computed once, checked here and nowhere else, then performed."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import BlockedError, InvalidInputError, StaleSceneError, UnreachableError
from sain_core.feasibility import Feasibility, gap_on_way, place_gap, start_gap
from sain_core.push import LENGTH, PushLimits, check_pushed, strokes
from sain_core.scene import check_on_table, check_states, unit
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import PushArray, Scene

RETREAT: Final = 0.01  # [m], room for errors of the places that bodies are taken to have


@dataclass(frozen=True)
class Stroke:
    """The tool's way in the world: a straight line from start (2,) to end (2,) [m]."""

    start: Float[ndarray, "2"]
    end: Float[ndarray, "2"]
    heading: float

    @classmethod
    def of_push(
        cls, scene: Scene, push: PushArray, limits: PushLimits, bodies: Bodies = PAPER_DISKS
    ) -> "Stroke":
        """Return the tool's way for a push (3,) or (4,) in a scene (N, 8), of disks by default."""
        start, heading = strokes(scene, push, limits, bodies)
        return cls(start, start + push[LENGTH] * unit(heading), float(heading))

    def from_further_back(self, way: float) -> "Stroke":
        """Return this stroke with a start that lies further back by a way [m]."""
        return replace(self, start=self.start - way * unit(np.asarray(self.heading)))

    @property
    def length(self) -> float:
        """The tool's travel [m]."""
        return float(np.linalg.norm(self.end - self.start))


def is_idle(push: PushArray) -> bool:
    """Tell whether a push has no length, and so moves nothing."""
    return bool(push[LENGTH] == 0.0)


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
    check_pushed(feasibility.limits.check(push), bodies)
    check_on_table(scene, feasibility.table)
    if not settled:
        raise StaleSceneError("the disks still move; a push needs a settled scene")
    if seen is None:
        return _possible(push, scene, feasibility, bodies)
    check_states(seen)
    if len(seen) != len(scene):
        raise InvalidInputError(
            f"the push was planned for {len(seen)} bodies; this world has {len(scene)}"
        )
    stroke = _possible(push, seen, feasibility, bodies)
    return stroke if is_idle(push) else _withdrawn(stroke, scene, feasibility, bodies)


def _possible(push: PushArray, scene: Scene, feasibility: Feasibility, bodies: Bodies) -> Stroke:
    """Return the tool's way; raise if it leaves the reach, or if a body is in it."""
    limits, reach = feasibility.limits, feasibility.reach
    stroke = Stroke.of_push(scene, push, limits, bodies)
    if is_idle(push):
        return stroke
    way = unit(np.asarray(stroke.heading))
    if not reach.covers(stroke.start, way, push[LENGTH]):
        numbers = ", ".join(f"{number:.3f}" for number in push[: LENGTH + 1])
        raise UnreachableError(
            f"the tool's way for push ({numbers}) leaves the"
            f" arm's reach of {reach.inner} to {reach.outer} m from the base,"
            f" |bearing| <= {reach.max_bearing} rad"
        )
    room = float(start_gap(scene, push, limits, bodies))
    if room < 0.0:
        raise BlockedError(
            f"the tool would start {-1e3 * room:.1f} mm inside the body that it is to push:"
            " the point is too near an inner corner of the outline"
        )
    gap = float(gap_on_way(stroke.start, way, scene, push, limits, bodies))
    if gap < feasibility.tool_margin:
        raise BlockedError(
            f"the tool would pass another body with a gap of {1e3 * gap:.1f} mm;"
            f" at least {1e3 * feasibility.tool_margin:g} mm is needed"
        )
    return stroke


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
