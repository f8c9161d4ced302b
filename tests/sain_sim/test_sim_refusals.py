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
from sain_core.scene import MASS, MID, RADIUS, X
from sain_sim.parameters import nominal_parameters
from sain_sim.workcell import WorldConfig
from sain_sim.world import World

REFUSED = [
    ((0.0, np.nan, 0.1), ErrorCode.INVALID, "angle of the push is nan; must be finite"),
    ((np.inf, 0.0, 0.1), ErrorCode.INVALID, "location of the push is inf; must be finite"),
    ((4.0, 0.0, 0.1), ErrorCode.OUT_OF_RANGE, "push location is 4.0000 rad; allowed: (-pi, pi]"),
    ((0.0, 1.0, 0.1), ErrorCode.OUT_OF_RANGE, "push angle is 1.0000 rad; allowed: +-0.7854 rad"),
    ((0.0, 0.0, 0.2), ErrorCode.OUT_OF_RANGE, "push length is 0.2000 m; allowed: [0, 0.15] m"),
    ((0.0, 0.0, -0.1), ErrorCode.OUT_OF_RANGE, "push length is -0.1000 m"),
    ((pi, 0.0, 0.1), ErrorCode.BLOCKED, "the tool would pass another disk with a gap of"),
]


@pytest.mark.parametrize("config", [WorldConfig(), WorldConfig(full_motion=True)])
@pytest.mark.parametrize(("push", "code", "message"), REFUSED)
def test_a_refused_push_moves_nothing(push, code, message, config, bench):
    with World(nominal_parameters(), config) as world:
        world.reset(bench.touching())
        before, joints, time = world.observe(), world.sample().joint_positions, world.time
        with pytest.raises(SainError) as caught:
            world.push(np.array(push))
        assert caught.value.code is code
        assert message in str(caught.value)
        assert np.array_equal(world.observe(), before)
        assert np.array_equal(world.sample().joint_positions, joints)
        assert world.time == time


def test_out_of_reach_is_refused_as_unreachable(world):
    scene = nominal_parameters().scene(np.array([[0.70, 0.0], [0.70, 0.3]]))
    world.reset(scene)
    with pytest.raises(SainError) as caught:
        world.push(np.array([pi, 0.0, 0.1]))
    assert caught.value.code is ErrorCode.UNREACHABLE
    assert "leaves the arm's reach of 0.2 to 0.74 m" in str(caught.value)
    assert np.array_equal(world.observe(), world.observe())
    assert np.allclose(world.observe(), scene, atol=1e-12)


def find_dynamic_refusal(bench):
    """Return a world that refuses a push only after having tried it, and that push."""
    for seed in range(60):
        parameters, start = bench.drawn(seed, 5)
        world = World(parameters)
        world.reset(start)
        for push in bench.pushes(seed, start, 12):
            try:
                world.check(push)
            except SainError:
                continue
            try:
                world.push(push)
            except BlockedError as error:
                return world, push, str(error), start, parameters
            world.reset(start)
        world.close()
    raise AssertionError("no push was refused after a look ahead; the tests need one")


def test_a_disk_shoved_into_the_tools_way_blocks_and_leaves_no_trace(bench):
    world, push, message, start, parameters = find_dynamic_refusal(bench)
    assert "the tool would come to touch disk" in message
    assert np.allclose(world.observe(), start, atol=1e-12)
    seen = []
    with pytest.raises(BlockedError):
        world.push(push, on_step=seen.append)
    assert not seen  # nobody sees a push that is refused
    follow_up = [p for p in bench.pushes(77, start, 40) if possible(world, p)][:2]
    assert follow_up
    with World(parameters) as fresh:
        fresh.reset(start)
        for each in follow_up:
            assert outcome_of(world, each) == outcome_of(fresh, each)
    world.close()


def possible(world, push) -> bool:
    try:
        world.check(push)
    except SainError:
        return False
    return True


def outcome_of(world, push) -> bytes | str:
    try:
        return world.push(push).after.tobytes()
    except SainError as error:
        return str(error)


def test_a_scene_in_motion_takes_no_push(world, bench):
    world.reset(bench.touching())
    world._client.resetBaseVelocity(world._cell.stage.disks[MID].body, [0.1, 0.0, 0.0])
    with pytest.raises(StaleSceneError, match="the disks still move"):
        world.push(bench.straight)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({(MID, X): np.nan}, InvalidInputError, "x of disk 0 is nan; must be finite"),
        ({(1, X): 0.45}, InvalidInputError, "disks 0 and 1 overlap by"),
        ({(1, X): 1.5}, OffTableError, "disk 1 at (1.500, 0.000) m is off the table"),
        ({(1, MASS): 7.0}, InvalidInputError, "mass of disk 1 is 7 in the scene and 8 in this"),
        ({(0, RADIUS): 0.075}, InvalidInputError, "radius of disk 0 is 0.075 in the scene"),
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


def test_a_scene_with_another_number_of_disks_is_refused(world):
    scene = nominal_parameters(3).scene(np.array([[0.4, 0.0], [0.6, 0.0], [0.4, 0.3]]))
    with pytest.raises(InvalidInputError, match="the scene has 3 disks; this world has 2"):
        world.reset(scene)
