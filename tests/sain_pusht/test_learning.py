"""What pushes tell of gym-pusht's physics."""

import numpy as np

from sain_pusht.block import BLOCK_RADIUS, CENTROID, PIXEL, UNIT, pusht_bodies
from sain_pusht.identification import data_set, errors, identify, random_pushes, textbook
from sain_pusht.world import PushtWorld


def test_a_hundred_pushes_tell_the_centre_of_mass_and_how_blocks_turn(world: PushtWorld) -> None:
    rows = list(random_pushes(14, world, first=900))
    data = data_set(rows[:100], pusht_bodies())
    known = identify(data.alike)
    rest = data_set(rows[100:], pusht_bodies())
    before, after = (
        np.median(errors(one.prior, rest.alike), axis=0) for one in (textbook(), known)
    )
    assert (after < 0.25 * before).all()
    # gym-pusht: 45 pixels from the middle of the bar's outer side
    true = (-45.0 - CENTROID[1] * UNIT) * PIXEL / BLOCK_RADIUS
    assert abs(known.centre[1] - true) < 0.01
    assert abs(known.centre[0]) < 0.01
    assert known.tool_friction < 0.02
