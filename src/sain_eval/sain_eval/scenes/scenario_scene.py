"""One scene to solve: bodies, their goal or goals, and the hidden truth about their world."""

from dataclasses import dataclass, replace
from typing import Final

from sain_core.goal import Goal
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.library import check_shapes
from sain_core.types import Scene
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.truth import RANDOMISED_TRUTH, TruthConfig

MAX_PUSHES: Final = 15  # paper section II-D


@dataclass(frozen=True)
class ScenarioScene:
    """One scene to solve, with the hidden truth about its world.

    Attributes:
        scenario: its name.
        seed: what it was drawn from.
        disks: (N, 8), the bodies at rest.
        friction: between bodies and table; hidden from all controllers but the oracle.
        shapes: a footprint for each body, as `sain_core.shapes` names them.
        goal: what bodies should come to.
        max_pushes: for each goal.
        truth: the world that it plays in.
        roles: of each body; none: the paper's.
        further: goals that follow without a reset, each once the one before is reached.
    """

    scenario: str
    seed: int
    disks: Scene
    friction: float
    shapes: tuple[str, ...]
    goal: Goal
    max_pushes: int = MAX_PUSHES
    truth: TruthConfig = RANDOMISED_TRUTH
    roles: tuple[str, ...] = ()
    further: tuple[Goal, ...] = ()

    @property
    def bodies(self) -> Bodies:
        """Shape and role of each body."""
        return Bodies.named(self.shapes, self.roles)

    @property
    def goals(self) -> tuple[Goal, ...]:
        """All goals, in order."""
        return (self.goal, *self.further)

    def within(self, truth: TruthConfig) -> "ScenarioScene":
        """Return the same scene in another world, with the friction that it has there."""
        moved = replace(self, truth=truth)
        return replace(moved, friction=moved.parameters().friction)

    def parameters(self) -> WorldParameters:
        """Return the simulated world that this scene plays in."""
        shapes = check_shapes(self.shapes)
        parameters = WorldParameters.of_scene(self.disks, self.friction, shapes, self.roles)
        return self.truth.roughen(parameters)
