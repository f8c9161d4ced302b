"""Strokes in gym-pusht: the block stays where it is until they begin."""

import numpy as np
import pytest

from sain_core.errors import UnreachableError
from sain_core.push import make_push, tool_end
from sain_core.scene import POSITION
from sain_core.shapes.shape import outline_of
from sain_pusht.agent import LIMITS
from sain_pusht.identification import random_pushes
from sain_pusht.model import PushtOracle
from sain_pusht.world import OVERLAP, PushtWorld


def test_the_tool_does_not_touch_the_block_on_its_way(world: PushtWorld) -> None:
    done = 0
    for _ in random_pushes(4, world, first=50):
        assert world.moved_before < 2 * OVERLAP
        done += 1
    assert done >= 20


def test_a_stroke_ends_where_it_should(world: PushtWorld) -> None:
    scene = world.reset(2)
    push = make_push(0.3, 0.1, 0.05)
    end = tool_end(scene, push, LIMITS, world.bodies)
    world.push(push)
    assert world.motion[0] == pytest.approx(end, abs=5e-5)
    assert np.abs(world.motion[1]).max() < 0.02


def test_a_refused_push_moves_nothing(world: PushtWorld) -> None:
    scene = world.reset(0)
    shape = world.bodies.shapes[0]
    middle = outline_of(shape).facing(np.array(0.0))[0]
    with pytest.raises(UnreachableError, match="no path for the tool"):
        world.inner.block.position = (30.0, 256.0)  # half of it is beyond the wall
        world.env.step(np.array([400.0, 400.0]))
        world.note(world.inner._get_info())
        scene, steps = world.scene, world.steps
        world.push(make_push(float(middle), 0.0, 0.03))
    assert world.steps == steps
    assert np.array_equal(world.scene, scene)


def test_the_oracle_predicts_what_happens(world: PushtWorld) -> None:
    oracle, off = PushtOracle(), []
    for scene, push, after, _ in random_pushes(2, world, first=60):
        told = oracle.step(scene[None], push[None])[0]
        off.append(np.linalg.norm((told - after)[0, POSITION]))
    assert np.median(off) < 2e-4
