"""What the planar prior takes for the physics: numbers that were fitted, without and with axes."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from sain_core.config import Config, option
from sain_core.push import TOOL_RADIUS
from sain_core.scene import MASS, MID
from sain_core.types import Scalars, Scenes
from sain_model.physics.parameters import parameter


@dataclass(frozen=True)
class PlanarConfig(Config):
    """The planar world's physics.

    From `foot_radius` to `disk_height` the values are fitted to Bullet with the arm on 1,871
    pushes of three-footed disks by ``ros2 run sain_eval calibrate`` (docs/explanation/planar.md):
    they make up for each other, and none should be read as a measurement. What each means is in
    `sain_model.physics.parameters`.
    """

    friction: float = parameter("friction", 0.12)
    gravity: float = option(9.81, "acceleration", unit="m/s^2", minimum=0.1, maximum=30.0)
    foot_radius: float = parameter("foot_radius", 0.7345)
    inertia: float = parameter("inertia", 0.4257)
    torsion: float = parameter("torsion", 1.0)
    friction_scale: float = parameter("friction_scale", 1.01)
    yield_across: float = parameter("yield_across", 0.7779)
    axes_yield: float = parameter("axes_yield", 0.0)
    tool_friction: float = parameter("tool_friction", 0.1211)
    disk_friction: float = parameter("disk_friction", 0.1254)
    tool_restitution: float = parameter("tool_restitution", 0.0036)
    disk_restitution: float = parameter("disk_restitution", 0.003)
    tool_compliance: float = parameter("tool_compliance", 0.0)
    body_compliance: float = parameter("body_compliance", 0.0)
    middle_height: float = parameter("middle_height", 0.0181)
    tool_height: float = parameter("tool_height", 0.0283)
    disk_height: float = parameter("disk_height", 0.0264)
    mass_ratio: float = parameter("mass_ratio", 1.0)
    centre_x: float = parameter("centre_x", 0.0)
    centre_y: float = parameter("centre_y", 0.0)
    grain_x: float = parameter("grain_x", 0.0)
    grain_y: float = parameter("grain_y", 0.0)
    table_grain_x: float = parameter("table_grain_x", 0.0)
    table_grain_y: float = parameter("table_grain_y", 0.0)
    slope_x: float = parameter("slope_x", 0.0)
    slope_y: float = parameter("slope_y", 0.0)
    pressure: float = parameter("pressure", 0.0)

    tool_radius: float = option(TOOL_RADIUS, "radius of the stick", unit="m", minimum=0.001)
    clearance: float = option(
        0.005, "gap between tool and rim at the start", unit="m", minimum=0.0, maximum=0.05
    )
    speed_factor: float = parameter("speed_factor", 1.0)
    acceleration: float = option(4.0, "of the tool", unit="m/s^2", minimum=0.1, maximum=50.0)
    tip_x: float = parameter("tip_x", 0.0)
    tip_y: float = parameter("tip_y", 0.0)
    length_offset: float = parameter("length_offset", 0.0)
    angle_offset: float = parameter("angle_offset", 0.0)
    location_offset: float = parameter("location_offset", 0.0)
    longest_step: float = option(
        0.02, "of time; all limits of steps scale with it", unit="s", minimum=1e-4, maximum=0.1
    )

    @property
    def has_axes(self) -> bool:
        """Whether friction is solved along the world's axes."""
        return self.axes_yield > 0.0


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
    yield_across=1.0,
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
