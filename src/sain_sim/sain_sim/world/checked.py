"""What all simulated worlds have in common: scenes and pushes are checked here, and only here."""

from abc import abstractmethod
from typing import Final

import numpy as np

from sain_core.errors import InvalidInputError
from sain_core.scene import MASS, RADIUS
from sain_core.shapes.bodies import check_bodies
from sain_core.types import PushArray, Scene
from sain_sim.arm.client import Closeable
from sain_sim.world.outcome import Observer, Sample, StrokeOutcome
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.stroke import Stroke, checked_stroke
from sain_sim.world.workcell import WorldConfig

MATCH_TOLERANCE: Final = 1e-6  # [kg] or [m]


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
    ) -> StrokeOutcome:
        """Execute one push (3,) and wait until the scene is settled.

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
        """Return the tool's way for a push (3,) that can be carried out from here.

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
