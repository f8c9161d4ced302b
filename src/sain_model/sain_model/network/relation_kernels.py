"""What two bodies, or a body and the tool, are to each other: features of a relation, compiled.

A relation also holds what its sender is, and how the tool meets the pushed body: what a body is
told depends on how its neighbour is pushed.
"""

import numpy as np

from sain_core.push import ANGLE, LENGTH
from sain_model.compute.compiling import compiled
from sain_model.network.inputs import (
    GAP_AFTER,
    GAP_BEFORE,
    GAP_SCALE,
    PLACE_SCALE,
)
from sain_model.network.patch_kernels import (
    APART,
    AT_X,
    AT_Y,
    EXTENT,
    NORMAL_X,
    NORMAL_Y,
    POSE_COS,
    POSE_RADIUS,
    POSE_SIN,
    POSE_X,
    POSE_Y,
)

IS_TOOL, EXTENT_BEFORE, EXTENT_AFTER = 0, 9, 11  # columns of a relation; gaps: `GAP_BEFORE`, ...
CONTACT_BEFORE, CONTACT_AFTER = 16, 24  # eight columns each
HEADINGS = 32  # eight columns, 0 for a network that does not see the world
SENDER = 40  # the features of the sender, 0 for the tool
TOOL_CONTACT = SENDER + 30  # twenty columns: gaps, extents and contacts of the tool
RELATION_FEATURES = TOOL_CONTACT + 20

CURVATURE_SCALE = 0.02  # [m], times 1 / radius
EXTENT_SCALE = 0.03  # [m]

# Columns that change their sign in a mirror, of a network that does not see the world.
_CONTACT = (1, 3, 5, 6, 7)
MIRRORED_RELATION = (
    13,
    *(CONTACT_BEFORE + column for column in _CONTACT),
    *(CONTACT_AFTER + column for column in _CONTACT),
    *(SENDER + column for column in (4, 6, 8, 10, 13, 14, 18)),
    *(TOOL_CONTACT + 4 + column for column in _CONTACT),
    *(TOOL_CONTACT + 12 + column for column in _CONTACT),
)


@compiled
def write_who(body, other, stroke, table, features, poses, lane, relation):
    """Write who tells and who is told; a tool has no mass and no inertia."""
    tool = other == features.shape[0]
    relation[IS_TOOL, lane] = 1.0 if tool else 0.0
    relation[1, lane] = features[body, 0, lane]
    relation[2, lane] = 0.0 if tool else features[other, 0, lane]
    relation[3, lane] = features[body, 1, lane]
    relation[4, lane] = 0.0 if tool else features[other, 1, lane]
    relation[5, lane] = features[body, 15, lane]
    relation[6, lane] = 0.0 if tool else features[other, 15, lane]
    curved, bent = table.rounding[body], table.rounding[other]
    relation[7, lane] = CURVATURE_SCALE * curved / poses[0, body, POSE_RADIUS]
    relation[8, lane] = CURVATURE_SCALE * bent / poses[0, other, POSE_RADIUS]
    relation[12, lane], relation[13, lane] = np.cos(stroke[ANGLE]), np.sin(stroke[ANGLE])
    relation[14, lane] = stroke[LENGTH] / PLACE_SCALE


@compiled
def write_contact(patch, poses, body, other, way, when, lane, relation):
    """Write how a body meets another one: `way` is 1 where the normal leads there, else -1."""
    first = CONTACT_AFTER if when == 1 else CONTACT_BEFORE
    gap = GAP_AFTER if when == 1 else GAP_BEFORE
    extent = EXTENT_AFTER if when == 1 else EXTENT_BEFORE
    for column in range(first, first + 8):
        relation[column, lane] = 0.0
    relation[extent, lane] = 0.0
    relation[gap, lane] = 1.0
    if patch[APART] == np.inf:
        return
    relation[gap, lane] = np.tanh(max(patch[APART], 0.0) / GAP_SCALE)
    relation[extent, lane] = patch[EXTENT] / EXTENT_SCALE
    x, y = patch[AT_X] - poses[body, POSE_X], patch[AT_Y] - poses[body, POSE_Y]
    off_x, off_y = patch[AT_X] - poses[other, POSE_X], patch[AT_Y] - poses[other, POSE_Y]
    normal_x, normal_y = way * patch[NORMAL_X], way * patch[NORMAL_Y]
    relation[first, lane], relation[first + 1, lane] = x / PLACE_SCALE, y / PLACE_SCALE
    relation[first + 2, lane], relation[first + 3, lane] = off_x / PLACE_SCALE, off_y / PLACE_SCALE
    relation[first + 4, lane], relation[first + 5, lane] = normal_x, normal_y
    relation[first + 6, lane] = (x * normal_y - y * normal_x) / PLACE_SCALE
    relation[first + 7, lane] = (off_x * normal_y - off_y * normal_x) / PLACE_SCALE


@compiled
def write_headings(patch, poses, body, other, way, when, lane, relation):
    """Write the headings of both bodies about the normal: where their masses lie to one side."""
    first = HEADINGS + 4 * when
    for column in range(first, first + 4):
        relation[column, lane] = 0.0
    if patch[APART] == np.inf:
        return
    normal_x, normal_y = way * patch[NORMAL_X], way * patch[NORMAL_Y]
    cos, sin = poses[body, POSE_COS], poses[body, POSE_SIN]
    relation[first, lane] = cos * normal_x + sin * normal_y
    relation[first + 1, lane] = sin * normal_x - cos * normal_y
    cos, sin = poses[other, POSE_COS], poses[other, POSE_SIN]
    relation[first + 2, lane] = cos * normal_x + sin * normal_y
    relation[first + 3, lane] = sin * normal_x - cos * normal_y


@compiled
def write_context(work, pushed, sent, lane):
    """Write to each relation what its sender is, and how the tool meets the pushed body."""
    count = work.bodies.shape[0]
    tool = work.relations[pushed * count + pushed]
    for body in range(count):
        for slot in range(count):
            relation = work.relations[body * count + slot]
            if slot != body:
                _copy(work.bodies[slot], 0, sent, lane, relation, SENDER)
            _copy(tool, EXTENT_BEFORE, 3, lane, relation, TOOL_CONTACT)
            _copy(tool, GAP_AFTER, 17, lane, relation, TOOL_CONTACT + 3)


@compiled
def _copy(source, first, count, lane, relation, at):
    for row in range(count):
        relation[at + row, lane] = source[first + row, lane]
