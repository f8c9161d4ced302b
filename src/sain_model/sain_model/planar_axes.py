"""The planar prior whose friction knows the world's axes, as that of Bullet's solver does.

Bullet solves the friction of a foot along the world's x and y, each weighted by how hard the foot
is to move that way. That is no physics: this prior does not turn with the scene, but by quarters
of a turn and in the axes' mirrors. Against Bullet it errs a third as much as the prior without.
"""

from typing import Final

from sain_model.planar import PlanarConfig

AXES: Final = PlanarConfig(
    friction_scale=1.0189,
    axes_yield=0.7197,
    tool_friction=0.1209,
    disk_friction=0.1217,
    tool_restitution=0.002,
    disk_restitution=0.0142,
    foot_radius=0.7236,
    inertia=0.4817,
    middle_height=0.0138,
    tool_height=0.0211,
    disk_height=0.0205,
)
"""Fitted by ``ros2 run sain_eval calibrate --axes`` (docs/model.md)."""
