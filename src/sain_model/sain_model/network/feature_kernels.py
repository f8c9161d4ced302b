"""What the network sees, written once: NumPy runs it for training, Numba compiles it for planning.

`write_features` writes the features of one push into its lane. In a kernel a lane is a number and a
scene is (N, 8); for NumPy the lane is `ALL_LANES`, and each number of a scene is an array over the
pushes.

The scene is seen in the frame of the push: the origin is the mid disk's centre before the push, the
x axis points along the push's ``location``, so that the tool always comes from -x. Scenes that
differ by where they are and how they are turned have the same features up to rounding; renumbering
disks renumbers rows. A network of one laboratory sees places and headings too: ten more columns.

Lengths are divided by constants, so that the inputs are of order one.
"""

from typing import NamedTuple

import numpy as np

from sain_core.push import ANGLE, LENGTH, LOCATION
from sain_core.scene import MASS, MID, RADIUS, THETA, X, Y
from sain_model.compute.compiling import compiled, compiled_apart, shared

FEATURE_VERSION = 1  # raise it with every change of meaning, order or scale below
DISK_FEATURES = 15
PLACE_FEATURES = 10  # columns of a disk behind those, for a network that sees the world
RELATION_FEATURES = 16
GAP_BEFORE = 10  # columns of the relation features: 0 where two disks touch, 1 far apart
GAP_AFTER = 15

PLACE_SCALE = 0.1  # [m]
MOVE_SCALE = 0.05  # [m]
TURN_SCALE = 0.2  # [rad]
GAP_SCALE = 0.02  # [m], beyond which it hardly matters how far apart two disks are
MASS_MIDDLE = 8.0  # [kg]
MASS_SCALE = 1.0  # [kg]
RADIUS_MIDDLE = 0.07  # [m]
RADIUS_SCALE = 0.01  # [m]
TABLE_X, TABLE_Y = 0.5, 0.0  # [m], the middle of the table
TABLE_SCALE = 0.2  # [m]

LANES = 128  # pushes side by side: the widest layers still fit into a core's nearest cache
ALL_LANES = slice(None)
TURN = 2.0 * np.pi
BEFORE_X, BEFORE_Y, AFTER_X, AFTER_Y = range(4)  # rows of a disk's places
KIND_MID, KIND_MASS, KIND_RADIUS = range(3)  # rows of what a disk is


class NetworkWork(NamedTuple):
    """Features of pushes, one in each lane. E = N (N - 1) relations, sorted by the receiver.

    The last two are scratch memory of the kernels.
    """

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


@shared
def wrap(angle):
    """Wrap an angle [rad] to (-pi, pi]."""
    return np.pi - (np.pi - angle) % TURN


@shared
def write_features(before, push, after, lane, places, work):
    """Write the features of one push into its lane, or of all pushes into all lanes.

    Args:
        before: scene (N, 8) before the push; each number may be an array over the pushes.
        push: (3,), likewise.
        after: scene (N, 8) that the prior predicts, likewise.
        lane: which; `ALL_LANES`: all.
        places: whether the network sees places and headings.
        work: memory to fill.
    """
    cos, sin = np.cos(push[LOCATION]), np.sin(push[LOCATION])
    for disk in range(before.shape[0]):
        _write_disk(before[disk], before[MID], push, after[disk], cos, sin, disk, lane, work)
        work.disks[disk, KIND_MID, lane] = 1.0 if disk == MID else 0.0
        if places:
            _write_place(before[disk], push, after[disk], cos, sin, disk, lane, work)
    for first in range(before.shape[0]):
        for second in range(first):
            _write_pair(first, second, lane, work)


@compiled_apart
def write_lane(before, push, after, lane, places, work):
    """Write the features of one push into its lane, compiled once for all kernels."""
    write_features(before, push, after, lane, places, work)


@shared
def _write_disk(before, origin, push, after, cos, sin, disk, lane, work):
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


@shared
def _write_place(before, push, after, cos, sin, disk, lane, work):
    """Write what tells places and headings apart: what is learned with it holds for one table."""
    features = work.disks[disk]
    features[DISK_FEATURES, lane] = (before[X] - TABLE_X) / TABLE_SCALE
    features[DISK_FEATURES + 1, lane] = (before[Y] - TABLE_Y) / TABLE_SCALE
    features[DISK_FEATURES + 2, lane] = (after[X] - TABLE_X) / TABLE_SCALE
    features[DISK_FEATURES + 3, lane] = (after[Y] - TABLE_Y) / TABLE_SCALE
    features[DISK_FEATURES + 4, lane], features[DISK_FEATURES + 5, lane] = cos, sin  # downhill
    twice = 2.0 * push[LOCATION]  # grain is the same there and back
    features[DISK_FEATURES + 6, lane] = np.cos(twice)
    features[DISK_FEATURES + 7, lane] = np.sin(twice)
    heading = before[THETA] - push[LOCATION]  # a disk's mass lies to one side
    features[DISK_FEATURES + 8, lane] = np.cos(heading)
    features[DISK_FEATURES + 9, lane] = np.sin(heading)


@shared
def _write_pair(first, second, lane, work):
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
        there[gap - 4, lane], there[gap - 3, lane] = x / PLACE_SCALE, y / PLACE_SCALE
        there[gap - 2, lane], there[gap - 1, lane] = x / (distance + 1e-9), y / (distance + 1e-9)
        for column in range(gap - 4, gap):
            back[column, lane] = -there[column, lane]
        there[gap, lane] = back[gap, lane] = np.tanh((distance - rims) / GAP_SCALE)
