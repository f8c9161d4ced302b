"""The planar prior: a batched contact simulator of bodies on a table, without an arm.

It is the fast f_p of the paper's equation 2 that can sit inside every rollout. It believes the
mass and radius that the scene states and, unless told better, the nominal friction.
"""

from dataclasses import dataclass, replace
from typing import Self

from sain_core.model import IdentityPrior, Model, answering, check_step
from sain_core.push import LENGTH, PushLimits, is_stroke, pushed_bodies, tip_radii
from sain_core.scene import MASS
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Pushes, Scenes
from sain_model.compute.batch_checks import check_batch
from sain_model.compute.kernel_store import compile_visibly
from sain_model.physics.body_table import Touched, body_table, push_bodies, tool_ways
from sain_model.physics.first_touch import check_starts
from sain_model.physics.parameters import Values, check_values, rows_of
from sain_model.physics.planar_config import PlanarConfig


@dataclass(frozen=True)
class PlanarPrior(Model):
    """Predicts pushes by simulating them in the plane."""

    config: PlanarConfig = PlanarConfig()
    bodies: Bodies = PAPER_DISKS  # that are pushed

    def __post_init__(self) -> None:
        """See that the kernels are compiled: no plan is to wait for them."""
        compile_visibly()

    def with_bodies(self, bodies: Bodies) -> Self:
        """Return this prior for scenes of these bodies."""
        return self if bodies == self.bodies else replace(self, bodies=bodies)

    def step(self, scenes: Scenes, pushes: Pushes, values: Values | None = None) -> Scenes:
        """Predict the settled scenes (B, N, 8) after pushes from scenes (B, N, 8).

        Args:
            scenes: settled scenes; velocities are taken as zero.
            pushes: one push (B, 5) or stroke (B, 8) a scene. Length 0 leaves the scene unchanged,
                bit for bit.
            values: parameters by name (`sain_model.physics.parameters`), (B,); those of bodies
                (B,) or (B, N). The settings have the others.

        Raises:
            InvalidInputError: wrong shapes, NaN or Inf; a value that is not allowed; a stroke that
                begins inside a body.
            OutOfRangeError: a push that no model may be asked about.
        """
        return self.step_with_contacts(scenes, pushes, values)[0]

    def step_with_contacts(
        self, scenes: Scenes, pushes: Pushes, values: Values | None = None
    ) -> tuple[Scenes, Touched]:
        """As `step`, and tell for each push which bodies the tool touched, (B, N)."""
        return self.step_as_if(scenes, scenes, pushes, values)

    def step_as_if(
        self, scenes: Scenes, believed: Scenes, pushes: Pushes, values: Values | None = None
    ) -> tuple[Scenes, Touched]:
        """As `step_with_contacts`, with masses and radii that are believed, (B, N, 8).

        The tool moves as it does in truth: its way comes from the scenes. Overlaps of bodies that
        are believed too large are undone without giving them speed.
        """
        check_batch(scenes, pushes, self.bodies)
        values = values or {}
        batch, count, _ = scenes.shape
        check_values(values, batch, count)
        config, bodies = self.config, self.bodies.fitted(count)
        physics, own = rows_of(config, values, batch, count)
        if is_stroke(pushes):
            check_starts(scenes, pushes, bodies)
        limits = PushLimits(tool_radius=config.tool_radius, clearance=config.clearance)
        physics["tool_radius"] = tip_radii(pushes, limits)
        ways = tool_ways(scenes, pushes, limits, bodies, physics)
        table, pushed = body_table(bodies), pushed_bodies(pushes)
        after, touched = push_bodies(believed, ways, pushed, table, physics, own)
        idle = pushes[:, LENGTH] == 0.0
        after[idle] = scenes[idle]
        after[..., MASS:] = scenes[..., MASS:]
        return after, touched


def step_knowing(prior: Model, scenes: Scenes, pushes: Pushes, values: Values | None) -> Scenes:
    """Predict with a prior that is given values of parameters, if it has any."""
    if isinstance(prior, PlanarPrior):
        return prior.step(scenes, pushes, values)
    if isinstance(prior, IdentityPrior):
        return prior.step(scenes, pushes)
    with answering("the prior"):
        return check_step(prior.step(scenes, pushes), scenes, "the prior")
