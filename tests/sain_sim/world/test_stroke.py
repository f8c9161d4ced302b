"""Pushes from where the bodies are taken to be."""

import numpy as np
import pytest

from sain_core.errors import BlockedError, InvalidInputError
from sain_core.push import make_push
from sain_core.scene import MID, POSITION, TARGET, Y
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.start import paper_start
from sain_sim.world.world import World

PUSH = make_push(0.0, 0.0, 0.10)


@pytest.fixture(scope="module")
def world():
    parameters = nominal_parameters()
    with World(parameters) as made:
        yield made


def pushed(world, shift=(0.0, 0.0)):
    start = world.reset(paper_start(world.parameters))
    seen = start.copy()
    seen[MID, POSITION] += shift
    return world.push(PUSH, seen=seen).after


def test_the_tool_goes_where_the_body_is_taken_to_be(world):
    straight, aside = pushed(world), pushed(world, (0.0, 0.004))
    world.reset(paper_start(world.parameters))
    exact = world.push(PUSH).after
    np.testing.assert_allclose(straight, exact, atol=1e-3)  # a longer run-up, no more
    assert aside[TARGET, Y] < straight[TARGET, Y] - 1e-3  # pushed on its left, it goes right


def test_a_tool_that_would_be_lowered_into_a_body_moves_nothing(world):
    with pytest.raises(BlockedError, match=r"lowered 5\.\d mm into a body"):
        pushed(world, (0.02, 0.0))
    assert world.observe().tobytes() == paper_start(world.parameters).tobytes()


def test_what_is_seen_must_be_of_this_world(world):
    with pytest.raises(InvalidInputError, match="for 1 bodies; this world has 2"):
        world.push(PUSH, seen=world.observe()[:1])
