"""Pushes from where bodies are taken to be, where that is not where they are."""

from typing import Final

from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import BlockedError, InvalidInputError
from sain_core.feasibility import Feasibility, place_gap
from sain_core.scene import check_states
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Scene
from sain_sim.world.outcome import Stroke

RETREAT: Final = 0.01  # [m], room for errors of the places that bodies are taken to have


def believed_scene(scene: Scene, seen: Float[ndarray, "M 8"] | None) -> Float[ndarray, "_ 8"]:
    """Return the scene (N, 8) that a push starts from: as seen, else as it is.

    Raises:
        InvalidInputError: another number of bodies, NaN or Inf, or a mass or radius not positive.
    """
    if seen is None:
        return scene
    check_states(seen)
    if len(seen) != len(scene):
        raise InvalidInputError(
            f"the push was planned for {len(seen)} bodies; this world has {len(scene)}"
        )
    return seen


def withdrawn(
    stroke: Stroke, scene: Scene, feasibility: Feasibility, bodies: Bodies = PAPER_DISKS
) -> Stroke:
    """Return a stroke that starts further back by `RETREAT`, for bodies that are seen elsewhere.

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
