"""The planar prior whose friction knows the world's axes, as that of Bullet's solver does.

Bullet solves the friction of a foot along the world's x and y, each weighted by how hard the foot
is to move that way. That is no physics: this prior does not turn with the scene, but by quarters
of a turn and in the axes' mirrors. Against Bullet it errs a third as much as the prior without.
"""

from typing import Final

from sain_model.physics.planar import PlanarConfig

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
"""Fitted to 1,871 pushes by ``ros2 run sain_eval calibrate --axes`` (docs/planar.md)."""
