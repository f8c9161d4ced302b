from math import pi

import numpy as np
import pytest

from sain_core.errors import (
    BlockedError,
    ErrorCode,
    InvalidInputError,
    OffTableError,
    SainError,
    StaleSceneError,
)
from sain_core.feasibility import Stroke
from sain_core.push import make_push
from sain_core.scene import MASS, MID, RADIUS, X
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.workcell import Watch, WorldConfig
from sain_sim.world.world import World

REFUSED = [
    ((0.0, np.nan, 0.1), ErrorCode.INVALID, "angle of the push is nan; must be finite"),
    ((np.inf, 0.0, 0.1), ErrorCode.INVALID, "location of the push is inf; must be finite"),
    ((4.0, 0.0, 0.1), ErrorCode.OUT_OF_RANGE, "push location is 4.0000 rad; allowed: (-pi, pi]"),
    ((0.0, 1.0, 0.1), ErrorCode.OUT_OF_RANGE, "push angle is 1.0000 rad; allowed: +-0.7854 rad"),
    ((0.0, 0.0, 0.2), ErrorCode.OUT_OF_RANGE, "push length is 0.2000 m; allowed: [0, 0.15] m"),
    ((0.0, 0.0, -0.1), ErrorCode.OUT_OF_RANGE, "push length is -0.1000 m"),
    ((pi, 0.0, 0.1), ErrorCode.BLOCKED, "the tool would pass another body with a gap of"),
]


@pytest.mark.parametrize("config", [WorldConfig(), WorldConfig(full_motion=True)])
@pytest.mark.parametrize(("push", "code", "message"), REFUSED)
def test_a_refused_push_moves_nothing(push, code, message, config, bench, engine):
    with World(nominal_parameters(), config, engine=engine) as world:
        world.reset(bench.touching())
        before, joints, time = world.observe(), world.sample().joint_positions, world.time
        with pytest.raises(SainError) as caught:
            world.push(make_push(*push))
        assert caught.value.code is code
        assert message in str(caught.value)
        assert np.array_equal(world.observe(), before)
        assert np.array_equal(world.sample().joint_positions, joints)
        assert world.time == time


def test_out_of_reach_is_refused_as_unreachable(world):
    scene = nominal_parameters().scene(np.array([[0.70, 0.0], [0.70, 0.3]]))
    world.reset(scene)
    with pytest.raises(SainError) as caught:
        world.push(make_push(pi, 0.0, 0.1))
    assert caught.value.code is ErrorCode.UNREACHABLE
    assert "leaves the arm's reach: 0.2 to 0.74 m" in str(caught.value)
    assert np.array_equal(world.observe(), world.observe())
    assert np.allclose(world.observe(), scene, atol=1e-12)


@pytest.mark.parametrize("config", [WorldConfig(), WorldConfig(full_motion=True)])
def test_a_tool_that_meets_another_disk_goes_back_and_leaves_no_trace(config, bench, engine):
    """The look ahead that no static check can replace: here none has seen the target."""
    start = bench.touching(bearing=pi / 2)
    into_target = Stroke(np.array([0.30, 0.14]), np.array([0.44, 0.14]), 0.0)
    worlds = (World(nominal_parameters(), config, engine=engine) for _ in range(2))
    with next(worlds) as world, next(worlds) as calm:
        for each in (world, calm):
            each.reset(start)
            each.push(bench.straight)
        before, joints, time = world.observe(), world.sample().joint_positions, world.time
        with pytest.raises(BlockedError, match="the tool would touch body 1 on its way"):
            world.carry_out(into_target)
        planner = world._planner = world._simulation.planner  # of an empty table
        planner.among = lambda *_: planner
        seen = []
        for watch in (None, Watch(seen.append, 1)):
            with pytest.raises(BlockedError) as caught:
                world.carry_out(into_target, watch)
            assert "the tool would come to touch body 1; this push may touch only" in str(
                caught.value
            )
            assert np.array_equal(world.observe(), before)
            assert np.array_equal(world.sample().joint_positions, joints)
            assert world.time == time
        assert not seen  # nobody sees a push that is refused
        unguarded = calm.carry_out(into_target, guarded=False).after
        assert unguarded[1, X] > before[1, X] + 0.01  # it was really in the way
        calm.reset(start)
        calm.push(bench.straight)
        again = bench.towards(0.3)
        assert np.array_equal(world.push(again).after, calm.push(again).after)


def test_a_scene_in_motion_takes_no_push(world, bench):
    world.reset(bench.touching())
    bench.kick(world, MID, (0.1, 0.0))
    with pytest.raises(StaleSceneError, match="the disks still move"):
        world.push(bench.straight)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({(MID, X): np.nan}, InvalidInputError, "x of disk 0 is nan; must be finite"),
        ({(1, X): 0.45}, InvalidInputError, "bodies 0 (disk) and 1 (disk) overlap by"),
        ({(1, X): 1.5}, OffTableError, "disk 1 at (1.500, 0.000) m is off the table"),
        ({(1, MASS): 7.0}, InvalidInputError, "mass of body 1 is 7 in the scene and 8 in this"),
        ({(0, RADIUS): 0.075}, InvalidInputError, "radius of body 0 is 0.075 in the scene"),
    ],
)
def test_a_scene_that_cannot_be_is_refused_and_the_world_stays(
    change, error, message, world, bench
):
    world.reset(bench.touching())
    before = world.observe()
    scene = bench.touching()
    for place, value in change.items():
        scene[place] = value
    with pytest.raises(error) as caught:
        world.reset(scene)
    assert message in str(caught.value)
    assert np.array_equal(world.observe(), before)
