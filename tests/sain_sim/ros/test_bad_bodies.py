"""Resets with bodies that cannot be: each error names the body and its value."""

import numpy as np
import pytest

from sain_core.errors import SainError
from sain_core.scene import make_scene
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.start import draw_episode
from sain_sim.world.truth import TruthConfig
from sain_sim.world.world import World

NAMES = ("t", "disk", "star", "l", "cube", "bar", "u", "plus", "hexagon", "arrow", "z")
APART = ((0.4, 0.0), (0.55, 0.2))
INSIDE = ((0.4, 0.0), (0.42, 0.01))


@pytest.fixture(scope="module")
def world():
    with World(nominal_parameters()) as made:
        yield made


def reset(world, places, shapes, roles=(), size=0.08):
    count = len(places)
    scene = make_scene(np.array(places, float), np.full(count, 8.0), np.full(count, size))
    parameters, start = draw_episode(0, TruthConfig("randomised"), scene, shapes, 0.12, roles=roles)
    return world.reset(start, parameters)


@pytest.mark.parametrize(
    ("places", "shapes", "roles", "size", "message"),
    [
        (INSIDE, ("t", "l"), (), 0.08, "bodies 0 (t) and 1 (l) overlap by 38.1 mm; at most 1 mm"),
        (INSIDE, ("t", "l"), ("pushable", "fixed"), 0.08, "bodies 0 (t) and 1 (l) overlap by 38.1"),
        (INSIDE, ("disk", "disk"), (), 0.08, "1 (disk) overlap by 137.6 mm; at most 1 mm"),
        (APART, ("t", "tt"), (), 0.08, "shape of body 1 is 'tt'; allowed: disk, cube,"),
        (APART, ("t", "l"), ("pushable", "glued"), 0.08, "role of body 1 is 'glued'; allowed:"),
        (APART, ("t", "l"), ("fixed", "movable"), 0.08, "no body is pushable: the roles are fixed"),
        (APART, ("t", "l"), ("pushable",), 0.08, "1 roles are given for 2"),
        (APART, ("t", "l"), (), 1e-4, "radii[0] is 0.0001 m; it must be at least 0.02 m"),
        (APART, ("t", "l"), (), 2.0, "radii[0] is 2.0 m; it must be at most 0.2 m"),
        (((0.4, 0.0), (3.0, 0.0)), ("t", "l"), (), 0.08, "disk 1 at (3.000, 0.000) m is off the"),
        (np.zeros((33, 2)), NAMES, (), 0.08, "the scene has 33 bodies; at most 32 are allowed"),
    ],
)
def test_bodies_that_cannot_be_are_named(world, places, shapes, roles, size, message):
    with pytest.raises(SainError) as caught:
        reset(world, places, shapes, roles, size)
    assert message in str(caught.value)
