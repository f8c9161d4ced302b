"""What the network sees, compiled: `network.features` for many pushes, one in each lane."""

from typing import NamedTuple

import numpy as np

from sain_core.push import ANGLE, LENGTH, LOCATION
from sain_core.scene import MASS, MID, RADIUS, THETA, X, Y
from sain_model.compute.compiling import compiled, compiled_apart
from sain_model.network.features import (
    GAP_AFTER,
    GAP_BEFORE,
    GAP_SCALE,
    MASS_MIDDLE,
    MASS_SCALE,
    MOVE_SCALE,
    PLACE_SCALE,
    RADIUS_MIDDLE,
    RADIUS_SCALE,
    TURN_SCALE,
)
from sain_model.network.place_features import TABLE_MIDDLE, TABLE_SCALE
from sain_model.network.settings import DISK_FEATURES

LANES = 128  # pushes side by side: the widest layers still fit into a core's nearest cache
TABLE_X, TABLE_Y = float(TABLE_MIDDLE[0]), float(TABLE_MIDDLE[1])
TURN = 2.0 * np.pi
BEFORE_X, BEFORE_Y, AFTER_X, AFTER_Y = range(4)  # rows of a disk's places
KIND_MID, KIND_MASS, KIND_RADIUS = range(3)  # rows of what a disk is


class NetworkWork(NamedTuple):
    """Scratch memory of `LANES` pushes. E = N (N - 1) relations, sorted by the receiver."""

    places: np.ndarray  # (N, 4, LANES) in the push frame, before and after [m]
    radii: np.ndarray  # (N, LANES) [m]
    disks: np.ndarray  # (N, inputs of f_dyn, LANES) float32
    relations: np.ndarray  # (E, inputs of f_rel, LANES) float32
    hidden: np.ndarray  # (2, widest layer, LANES) float32
    residual: np.ndarray  # (N, 3, LANES) dx, dy [m] in the push frame, dtheta [rad]


@compiled
def make_network_work(disks, relation_inputs, disk_inputs, widest):
    """Return scratch memory for this many disks; inputs that pad a layer stay zero."""
    return NetworkWork(
        np.zeros((disks, 4, LANES)),
        np.zeros((disks, LANES)),
        np.zeros((disks, disk_inputs, LANES), np.float32),
        np.zeros((disks * (disks - 1), relation_inputs, LANES), np.float32),
        np.empty((2, widest, LANES), np.float32),
        np.zeros((disks, 3, LANES)),
    )


@compiled
def wrap(angle):
    """Wrap an angle [rad] to (-pi, pi]."""
    return np.pi - (np.pi - angle) % TURN


@compiled_apart
def look(before, push, after, lane, places, work):
    """Write the features of one push into its lane.

    Args:
        before: scene (N, 8) before the push.
        push: (3,).
        after: scene (N, 8) that the prior predicts.
        lane: which.
        places: whether the network is told where and how turned things are.
        work: scratch memory to fill.
    """
    cos, sin = np.cos(push[LOCATION]), np.sin(push[LOCATION])
    for disk in range(before.shape[0]):
        _look_at_disk(before[disk], before[MID], push, after[disk], cos, sin, disk, lane, work)
        work.disks[disk, KIND_MID, lane] = 1.0 if disk == MID else 0.0
        if places:
            _look_at_place(before[disk], push, after[disk], cos, sin, disk, lane, work)
    for first in range(before.shape[0]):
        for second in range(first):
            _look_at_pair(first, second, lane, work)


@compiled
def _look_at_disk(before, origin, push, after, cos, sin, disk, lane, work):
    features, place = work.disks[disk], work.places[disk]
    for row, state in ((BEFORE_X, before), (AFTER_X, after)):
        x, y = state[X] - origin[X], state[Y] - origin[Y]
        place[row, lane], place[row + 1, lane] = cos * x + sin * y, cos * y - sin * x
    work.radii[disk, lane] = before[RADIUS]
    features[KIND_MASS, lane] = (before[MASS] - MASS_MIDDLE) / MASS_SCALE
    features[KIND_RADIUS, lane] = (before[RADIUS] - RADIUS_MIDDLE) / RADIUS_SCALE
    features[3, lane] = place[BEFORE_X, lane] / PLACE_SCALE
    features[4, lane] = place[BEFORE_Y, lane] / PLACE_SCALE
    # A disk on three feet looks the same after a third of a turn.
    feet = 3.0 * (before[THETA] - push[LOCATION])
    features[5, lane], features[6, lane] = np.cos(feet), np.sin(feet)
    moved_x = place[AFTER_X, lane] - place[BEFORE_X, lane]
    moved_y = place[AFTER_Y, lane] - place[BEFORE_Y, lane]
    features[7, lane], features[8, lane] = moved_x / MOVE_SCALE, moved_y / MOVE_SCALE
    features[9, lane] = np.sqrt(moved_x * moved_x + moved_y * moved_y) / MOVE_SCALE
    features[10, lane] = wrap(after[THETA] - before[THETA]) / TURN_SCALE
    way, across = push[LENGTH] / PLACE_SCALE, np.sin(push[ANGLE])
    features[11, lane] = way
    features[12, lane], features[13, lane] = np.cos(push[ANGLE]), across
    features[14, lane] = way * across  # how far the tool slides across


@compiled
def _look_at_place(before, push, after, cos, sin, disk, lane, work):
    features = work.disks[disk]
    features[DISK_FEATURES, lane] = (before[X] - TABLE_X) / TABLE_SCALE
    features[DISK_FEATURES + 1, lane] = (before[Y] - TABLE_Y) / TABLE_SCALE
    features[DISK_FEATURES + 2, lane] = (after[X] - TABLE_X) / TABLE_SCALE
    features[DISK_FEATURES + 3, lane] = (after[Y] - TABLE_Y) / TABLE_SCALE
    features[DISK_FEATURES + 4, lane], features[DISK_FEATURES + 5, lane] = cos, sin
    features[DISK_FEATURES + 6, lane] = cos * cos - sin * sin
    features[DISK_FEATURES + 7, lane] = 2.0 * cos * sin
    heading = before[THETA] - push[LOCATION]
    features[DISK_FEATURES + 8, lane] = np.cos(heading)
    features[DISK_FEATURES + 9, lane] = np.sin(heading)


@compiled
def _look_at_pair(first, second, lane, work):
    """Write what two disks are to each other, both ways round; first > second."""
    others = work.disks.shape[0] - 1
    there, back = (
        work.relations[first * others + second],
        work.relations[second * others + first - 1],
    )
    for kind in range(3):
        there[kind, lane] = back[3 + kind, lane] = work.disks[first, kind, lane]
        back[kind, lane] = there[3 + kind, lane] = work.disks[second, kind, lane]
    rims = work.radii[first, lane] + work.radii[second, lane]
    for row, gap in ((BEFORE_X, GAP_BEFORE), (AFTER_X, GAP_AFTER)):
        x = work.places[second, row, lane] - work.places[first, row, lane]
        y = work.places[second, row + 1, lane] - work.places[first, row + 1, lane]
        distance = np.sqrt(x * x + y * y)
        scale = 1.0 / (distance + 1e-9)
        there[gap - 4, lane], there[gap - 3, lane] = x / PLACE_SCALE, y / PLACE_SCALE
        there[gap - 2, lane], there[gap - 1, lane] = x * scale, y * scale
        for column in range(gap - 4, gap):
            back[column, lane] = -there[column, lane]
        there[gap, lane] = back[gap, lane] = np.tanh((distance - rims) / GAP_SCALE)
