"""What all simulated worlds have in common: scenes and pushes are checked here, and only here."""

from abc import abstractmethod
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import BlockedError, InvalidInputError, StaleSceneError
from sain_core.feasibility import Feasibility, place_gap
from sain_core.push import LENGTH, strokes
from sain_core.scene import MASS, RADIUS, check_on_table, check_states, unit
from sain_core.shapes.bodies import Bodies, check_bodies
from sain_core.types import PushArray, Scene
from sain_core.world import Outcome
from sain_sim.arm.client import Closeable
from sain_sim.world.outcome import Observer, Sample
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.stroke import Stroke
from sain_sim.world.workcell import WorldConfig

MATCH_TOLERANCE: Final = 1e-6  # [kg] or [m]
RETREAT: Final = 0.01  # [m], room for errors of the places that bodies are taken to have


class CheckedWorld(Closeable):
    """A `sain_core.world.AnyWorld` of bodies with parameters, in an engine.

    Attributes:
        config: how it is simulated.
        engine: its name.
        parameters: what is in it.
    """

    config: WorldConfig
    engine: str
    parameters: WorldParameters

    def reset(self, scene: Scene, parameters: WorldParameters | None = None) -> Scene:
        """Put the disks where a scene (N, 8) has them, at rest, and the arm at home.

        Args:
            scene: the poses; its masses and radii must be those of the parameters.
            parameters: of new disks; None keeps the present ones.

        Returns:
            The scene as observed: the given one with zero velocities.

        Raises:
            InvalidInputError: not a scene, or one of other disks than these.
            OffTableError: a disk off the table.
        """
        wanted = parameters or self.parameters
        _check_same(scene, wanted)
        check_bodies(scene, wanted.bodies, self.config.feasibility.table)
        self.load(scene, parameters)
        return self.observe()

    @abstractmethod
    def load(self, scene: Scene, parameters: WorldParameters | None = None) -> None:
        """Put the disks in a scene (N, 8) without checks; engines push overlapping disks apart."""

    @property
    @abstractmethod
    def time(self) -> float:
        """Simulated time [s] since the world was made; resets do not restart it."""

    @abstractmethod
    def observe(self) -> Scene:
        """Return the disks' states (N, 8) as they are."""

    @abstractmethod
    def sample(self) -> Sample:
        """Return the arm and the disks as they are."""

    @abstractmethod
    def push(
        self,
        push: PushArray,
        on_step: Observer | None = None,
        every: int = 1,
        seen: Scene | None = None,
    ) -> Outcome:
        """Execute one push (5,) and wait until the scene is settled.

        Args:
            push: location, angle and length.
            on_step: called with a `Sample` after each control step.
            every: steps between two calls.
            seen: (N, 8), where the bodies are taken to be: the tool's way follows from this. It
                starts a little further back. None: where they are.

        Raises:
            SainError: as `check`. No bit of the state changes then.
        """

    @abstractmethod
    def still(self) -> bool:
        """Tell whether every body on the table is settled."""

    def check(self, push: PushArray, seen: Scene | None = None) -> Stroke:
        """Return the tool's way for a push (5,) that can be carried out from here.

        Only `push` finds a pose that the arm cannot take, or a body that is moved into the tool's
        way.

        Raises:
            SainError: see `checked_stroke`.
        """
        return checked_stroke(
            push,
            self.observe(),
            self.still(),
            self.config.feasibility,
            self.parameters.bodies,
            seen,
        )


def _check_same(scene: Scene, parameters: WorldParameters) -> None:
    """Raise `InvalidInputError` unless a scene (N, 8) has the masses and radii of a world."""
    if len(scene) != parameters.count:
        raise InvalidInputError(
            f"the scene has {len(scene)} bodies; this world has {parameters.count}"
        )
    for column, name, values in (
        (MASS, "mass", parameters.masses),
        (RADIUS, "radius", parameters.radii),
    ):
        wrong = np.abs(scene[:, column] - values) > MATCH_TOLERANCE
        if wrong.any():
            disk = int(np.argmax(wrong))
            raise InvalidInputError(
                f"{name} of body {disk} is {scene[disk, column]:.6g} in the scene and"
                f" {values[disk]:.6g} in this world; they must be the same"
            )


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
    start, heading = strokes(planned_from, push, limits, bodies)
    check_on_table(scene, feasibility.table)
    if not settled:
        raise StaleSceneError("the disks still move; a push needs a settled scene")
    way = unit(heading)
    stroke = Stroke(start, start + push[LENGTH] * way, float(heading))
    if push[LENGTH] == 0.0:
        return stroke
    feasibility.check_way(start, way, planned_from, push, bodies)
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
