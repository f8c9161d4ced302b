"""The prior of gym-pusht's physics, from pushes: mass distribution, centre of mass, friction.

Nothing slides on there: a block that is not pushed stops at once. The closest that the planar prior
has is a table with much friction. What is left to find out is how blocks turn: there, by their
inertia, and not by where they stand. So supports stand where they give the same turn.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sain_core.scene import POSITION, THETA, wrap_angle
from sain_model.data.dataset import Part
from sain_model.inference.gauss_newton import fit
from sain_model.inference.kinds import Kind
from sain_model.physics.body_kernels import DISK_FEET, DISK_INERTIA
from sain_model.physics.planar import SHARE, PlanarConfig, PlanarPrior, body_table
from sain_pusht.agent import AGENT_RADIUS
from sain_pusht.block import BLOCK_RADIUS, pusht_bodies

STICKY: Final = PlanarConfig(
    tool_radius=AGENT_RADIUS,
    friction=2.0,
    gravity=30.0,
    friction_scale=1.0,
    tool_restitution=0.0,
    acceleration=8.0,
    speed_factor=0.5,  # fitted when pushes had no speed of their own
    longest_step=1 / 120,
)
WIDE: Final = 10.0  # standard deviation of z beforehand: the pushes decide
STEPS: Final = 30  # of the fit, at most


@dataclass(frozen=True)
class Identified:
    """What the pushes tell.

    Attributes:
        gyration: radius of gyration, in units of the block's radius.
        centre: (x, y) of the centre of mass from the centroid, in the block's frame and radii.
        tool_friction: between disk and block.
    """

    gyration: float
    centre: tuple[float, float]
    tool_friction: float

    @property
    def prior(self) -> PlanarPrior:
        """The prior with these parameters."""
        bodies = pusht_bodies(self.gyration)
        supports = body_table(bodies).supports
        even = STICKY.inertia / DISK_INERTIA
        arm = supports[:, SHARE] @ np.hypot(supports[:, 0], supports[:, 1])
        config = replace(
            STICKY,
            tool_friction=self.tool_friction,
            foot_radius=float(DISK_FEET * even**0.5 * self.gyration / arm),
            centre_x=self.centre[0],
            centre_y=self.centre[1],
        )
        return PlanarPrior(config, bodies)


def textbook() -> Identified:
    """Return what is assumed before any push: a uniform T, friction as in the planar prior."""
    even = float(np.sqrt(pusht_bodies().shapes[0].inertia(1.0, 1.0)[2]))
    return Identified(even, (0.0, 0.0), PlanarConfig().tool_friction)


def identify(data: Part) -> Identified:
    """Return the parameters that explain pushes best."""
    first = textbook()
    prior, names = first.prior, ("foot_radius", "centre_x", "centre_y", "tool_friction")
    kind = Kind("sticky", prior, names, WIDE**2 * np.eye(len(names)))
    pushes = data.observed.in_episodes(np.zeros(len(data), np.int64))
    found = fit(kind, [pushes], np.zeros((1, len(names))), np.zeros(1, np.int64), STEPS)
    values = {name: float(value[0].round(6)) for name, value in kind.values(found.places).items()}
    return Identified(
        first.gyration * values["foot_radius"] / prior.config.foot_radius,
        (values["centre_x"], values["centre_y"]),
        values["tool_friction"],
    )


def errors(prior: PlanarPrior, data: Part) -> np.ndarray:
    """Return how far blocks come to lie from where they are predicted (M, 2).

    In mm: the distance, and the turn at the block's circumscribed circle.
    """
    off = prior.step(data.state, data.action) - data.next_state
    turned = np.abs(wrap_angle(off[:, 0, THETA]))
    away = np.linalg.norm(off[:, 0, POSITION], axis=-1)
    return 1e3 * np.stack([away, BLOCK_RADIUS * turned], axis=-1)
