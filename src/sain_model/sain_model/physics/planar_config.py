"""What the planar prior takes for the physics: numbers that were fitted, without and with axes."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from sain_core.config import Config, option
from sain_core.push import TOOL_RADIUS
from sain_core.scene import MASS, MID
from sain_core.shapes.supports import BOTTOMS, FEET
from sain_core.types import Scalars, Scenes
from sain_model.physics.body_kernels import Physics


@dataclass(frozen=True)
class PlanarConfig(Config):
    """The planar world's physics.

    From `foot_radius` to `disk_height` the values are fitted to Bullet with the arm on 1,871
    pushes of three-footed disks by ``ros2 run sain_eval calibrate`` (docs/explanation/planar.md):
    they make up for each other, and none should be read as a measurement.
    """

    friction: float = option(
        0.12, "between disks and table, where none is given", minimum=0.001, maximum=2.0
    )
    gravity: float = option(9.81, "acceleration", unit="m/s^2", minimum=0.1, maximum=30.0)
    foot_radius: float = option(
        0.7345, "where a disk's three feet stand, share of its radius", minimum=0.01, maximum=1.0
    )
    inertia: float = option(
        0.4257, "moment of inertia, share of mass x radius^2", minimum=0.05, maximum=2.0
    )
    friction_scale: float = option(
        1.01, "table friction at work, share of the coefficient", minimum=0.5, maximum=2.0
    )
    yield_across: float = option(
        0.7779,
        "weight of a foot's motion across its arm in the direction of its friction: a solver"
        " gives way to where a foot is lighter to move",
        minimum=0.1,
        maximum=1.0,
    )
    axes_yield: float = option(
        0.0,
        "above 0, in place of `yield_across`: a solver weighs a foot's friction along the world's x"
        " and y by how hard the foot is to move that way, 1 / (1 + this x its share across)",
        minimum=0.0,
        maximum=5.0,
    )
    tool_friction: float = option(0.1211, "between tool and disk", minimum=0.0, maximum=2.0)
    disk_friction: float = option(0.1254, "between two disks", minimum=0.0, maximum=2.0)
    tool_restitution: float = option(
        0.0036, "share of the speed left when the tool hits a disk", minimum=0.0, maximum=0.9
    )
    disk_restitution: float = option(
        0.003, "share of the speed left when disks collide", minimum=0.0, maximum=0.9
    )
    middle_height: float = option(
        0.0181, "of a disk's centre of mass", unit="m", minimum=0.0, maximum=0.05
    )
    tool_height: float = option(
        0.0283, "where the tool presses on a disk", unit="m", minimum=0.0, maximum=0.06
    )
    disk_height: float = option(
        0.0264, "where one disk presses on another", unit="m", minimum=0.0, maximum=0.06
    )
    tool_radius: float = option(TOOL_RADIUS, "radius of the stick", unit="m", minimum=0.001)
    clearance: float = option(
        0.005, "gap between tool and rim at the start", unit="m", minimum=0.0, maximum=0.05
    )
    speed: float = option(0.2, "of the tool", unit="m/s", minimum=0.001, maximum=2.0)
    acceleration: float = option(4.0, "of the tool", unit="m/s^2", minimum=0.1, maximum=50.0)
    longest_step: float = option(0.02, "longest time step", unit="s", minimum=1e-4, maximum=0.1)
    stop_share: float = option(
        0.35,
        "longest step of a spinning disk, share of the time it takes to stop",
        minimum=0.001,
        maximum=0.5,
    )
    stop_step: float = option(
        1 / 120, "a disk about to stop needs no shorter steps", unit="s", minimum=1e-4, maximum=0.05
    )
    bend: float = option(
        0.05,
        "most that the normal of a pressing contact turns in a step",
        unit="rad",
        minimum=1e-3,
        maximum=0.3,
    )

    mass_ratio: float = option(
        1.0,
        "masses of bodies 1 and on over that of body 0, times what scenes state",
        minimum=0.01,
        maximum=100.0,
    )

    bottom: str = option(
        FEET,
        "what bodies stand on: three feet, or a flat bottom; of its true size at `foot_radius` 0.7",
        choices=BOTTOMS,
    )
    pressure: float = option(
        0.0,
        "of a flat bottom: exponent of the distance from its middle; 0: the same everywhere",
        minimum=-1.0,
        maximum=8.0,
    )

    @property
    def has_axes(self) -> bool:
        """Whether friction is solved along the world's axes."""
        return self.axes_yield > 0.0

    def physics(self) -> Physics:
        """Return the numbers that the compiled kernels take."""
        return Physics(*(float(getattr(self, name)) for name in Physics._fields))


def with_mass_ratio(scenes: Scenes, ratio: Scalars | float) -> Scenes:
    """Return scenes (B, N, 8) whose masses of bodies 1 and on, over that of body 0, are scaled.

    Half of the logarithm goes to body 0: the masses stay near those that networks were trained on.

    Args:
        scenes: as observed.
        ratio: by how much, one for all or (B,).
    """
    if np.all(ratio == 1.0):
        return scenes
    root = np.sqrt(ratio)
    scaled = scenes.copy()
    scaled[..., MID, MASS] /= root
    scaled[..., MID + 1 :, MASS] *= np.asarray(root)[..., None]
    return scaled


AXES: Final = PlanarConfig(
    axes_yield=0.7406,
    friction_scale=1.016,
    tool_friction=0.1212,
    disk_friction=0.121,
    tool_restitution=0.0179,
    disk_restitution=0.0017,
    foot_radius=0.7176,
    inertia=0.4797,
    middle_height=0.0178,
    tool_height=0.0196,
    disk_height=0.0196,
)
"""Fitted to 1,871 pushes by ``ros2 run sain_eval calibrate --axes`` (docs/explanation/planar.md).

Bullet solves the friction of a foot along the world's x and y, each weighted by how hard the foot
is to move that way. That is no physics: a prior with it does not turn with the scene, but by
quarters of a turn and in the axes' mirrors. Against Bullet it errs a third as much.
"""

TEXTBOOK: Final = PlanarConfig(
    foot_radius=0.7,
    inertia=0.5,
    friction_scale=1.0,
    yield_across=1.0,
    tool_friction=0.12,
    disk_friction=0.12,
    tool_restitution=0.0,
    disk_restitution=0.0,
    middle_height=0.02,
    tool_height=0.02,
    disk_height=0.02,
)
"""Fitted to nothing: Coulomb's law under the feet of a uniform disk, pushed at half its height.

Frictions are the paper's nominal one, and nothing bounces.
"""
