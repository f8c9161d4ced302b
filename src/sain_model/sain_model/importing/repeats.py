"""Which real pushes nearly repeat others: a split that divided them would test what was learned."""

from math import pi
from typing import Final

import numpy as np
from jaxtyping import Int
from numpy import ndarray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from sain_core.scene import wrap_angle
from sain_model.importing.real_pushes import RealPushes

NEAR: Final = 0.001  # [m], of the starts and of the lengths of two ways
NEARLY_ALONG: Final = pi / 180  # [rad], of their headings


def repeat_groups(pushes: RealPushes) -> Int[ndarray, "M"]:
    """Return the group of each push, from 0 on.

    Two of one body are in one group if their tools went the same way against it, seen from the
    body, within `NEAR` and `NEARLY_ALONG`; and so on from one to the next. Speed and surface do not
    matter: they change an outcome by less than what a model could remember of it.
    """
    start = pushes.in_body(pushes.tip_start)
    heading = pushes.heading - pushes.before[:, 2]
    groups, count = np.empty(len(pushes), np.int64), 0
    for name in dict.fromkeys(pushes.object.tolist()):
        own = np.flatnonzero(pushes.object == name)
        pairs = cKDTree(start[own]).query_pairs(NEAR, output_type="ndarray")
        first, second = own[pairs].T
        near = np.abs(wrap_angle(heading[first] - heading[second])) < NEARLY_ALONG
        near &= np.abs(pushes.length[first] - pushes.length[second]) < NEAR
        links = coo_matrix((np.ones(near.sum()), pairs[near].T), shape=(len(own), len(own)))
        found, labels = connected_components(links, directed=False)
        groups[own] = labels + count
        count += found
    _, first_seen, numbered = np.unique(groups, return_index=True, return_inverse=True)
    order = np.argsort(np.argsort(first_seen))
    return np.asarray(order[numbered])
