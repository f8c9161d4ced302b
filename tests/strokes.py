"""Where the tool stands at the ends of a push, and pushes and scenes that are turned."""

import numpy as np

from sain_core.push import LENGTH, LOCATION, SPAN, START, PushLimits, is_stroke, strokes
from sain_core.scene import POSITION, THETA, VX, VY, unit, wrap_angle
from sain_core.scene import turned as turned_by
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Points, Pushes, Scenes


def tool_start(
    scenes: Scenes, pushes: Pushes, limits: PushLimits, bodies: Bodies = PAPER_DISKS
) -> Points:
    """Return where the tool's axis stands before it travels, (..., 2) [m]."""
    return strokes(scenes, pushes, limits, bodies)[0]


def tool_end(
    scenes: Scenes, pushes: Pushes, limits: PushLimits, bodies: Bodies = PAPER_DISKS
) -> Points:
    """Return where the tool's axis stands after its travel, (..., 2) [m]."""
    start, heading = strokes(scenes, pushes, limits, bodies)
    return start + pushes[..., LENGTH, None] * unit(heading)


def rotate_scenes(scenes: Scenes, angle: float) -> Scenes:
    """Turn scenes about the world's origin by an angle [rad]."""
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[cos, sin], [-sin, cos]])  # row vectors times the transpose
    turned = scenes.copy()
    turned[..., POSITION] = scenes[..., POSITION] @ turn
    turned[..., VX : VY + 1] = scenes[..., VX : VY + 1] @ turn
    turned[..., THETA] = wrap_angle(scenes[..., THETA] + angle)
    return turned


def rotate_pushes(pushes: Pushes, angle: float) -> Pushes:
    """Turn pushes on disks, or strokes, by an angle [rad], as `rotate_scenes` turns the scene."""
    turned = pushes.copy()
    turned[..., LOCATION] = wrap_angle(pushes[..., LOCATION] + angle)
    if is_stroke(pushes):
        for vector in (START, SPAN):
            turned[..., vector] = turned_by(pushes[..., vector], angle)
    return turned
