"""Any robot in any engine: where its tool is, and that it pushes as others do."""

import numpy as np
import pytest

from sain_arm.planning.push_planner import PushPlanner
from sain_arm.robot.robot import read_robot, shipped
from sain_core.errors import UnreachableError
from sain_core.feasibility import Reach, Stroke
from sain_core.push import make_push
from sain_core.scene import DISK_HEIGHT, POSITION
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.workcell import WorldConfig
from sain_sim.world.world import World

OURS = ("free_tool", "paper_panda")
ROBOTS = (*OURS, "panda", "ur5", "xarm7")
PUSH = make_push(0.3, 0.1, 0.1)
MOTION = WorldConfig().motion


@pytest.fixture(scope="module")
def scene():
    return nominal_parameters().scene(np.array([[0.45, 0.0], [0.60, 0.05]]))


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_tool_goes_along_the_stroke_and_the_same_push_has_the_same_bytes(engine, robot, scene):
    samples, outcomes = [], []
    for _ in range(2):
        with World(nominal_parameters(), WorldConfig(robot=robot), engine) as world:
            world.reset(scene)
            stroke = world.check(PUSH)
            outcomes.append(world.push(PUSH, on_step=samples.append).after.tobytes())
    assert outcomes[0] == outcomes[1]
    pushing = [s for s in samples if s.phase == "push"]
    tools, commanded = (
        np.array([getattr(s, name) for s in pushing]) for name in ("tool", "commanded_tool")
    )
    assert np.abs(tools - commanded).max() < 1.5e-3
    along = (commanded[:, :2] - stroke.start) @ np.array(
        [np.cos(stroke.heading), np.sin(stroke.heading)]
    )
    assert along.max() == pytest.approx(stroke.length, abs=1e-4)
    assert np.allclose(commanded[:, 2], MOTION.tip_height, atol=1e-4)


@pytest.mark.parametrize("robot", ROBOTS)
def test_robots_push_alike(engine, robot, scene):
    ends = []
    for one in (robot, "free_tool"):
        with World(nominal_parameters(), WorldConfig(robot=one), engine) as world:
            world.reset(scene)
            ends.append(world.push(PUSH).after[:, POSITION])
    assert np.abs(ends[0] - ends[1]).max() < 6e-3


@pytest.mark.parametrize("robot", OURS)
def test_the_whole_stated_reach_can_be_taken_low_and_raised(robot):
    planner = PushPlanner(read_robot(robot), config=MOTION)
    reach = planner.robot.reach
    assert reach == Reach()  # what planners take for granted
    for bearing in np.linspace(-reach.max_bearing, reach.max_bearing, 5):
        way = np.array([np.cos(bearing), np.sin(bearing)])
        for height in (MOTION.tip_height, MOTION.raised):
            ring = np.linspace(reach.inner, reach.outer, 30)
            tips = np.insert(ring[:, None] * way, 2, height, axis=1)
            joints = planner.kinematics.follow(planner.robot.home, tips)
            assert np.allclose(planner.arm.tips(joints), tips, atol=1e-4)


def test_a_stroke_beyond_the_arm_is_refused_with_its_place(scene):
    planner = PushPlanner(read_robot("paper_panda"), config=MOTION)
    far = Stroke(np.array([0.85, 0.0]), np.array([0.95, 0.0]), 0.0)
    with pytest.raises(
        UnreachableError,
        match=r"at \(0\.850, 0\.000, 0\.088\) m: the tip would be 1\d\d\.\d mm off",
    ):
        planner.plan(far, scene, None)


def test_the_tool_meets_bodies_at_half_their_height():
    config = WorldConfig()
    assert config.motion.tip_height + config.rise == DISK_HEIGHT / 2


@pytest.mark.parametrize("robot", shipped())
def test_the_tool_is_where_the_kinematics_have_it_after_steps(engine, robot):
    with World(nominal_parameters(), WorldConfig(robot=robot), engine) as world:
        positions, speeds = world.joint_states()
        np.testing.assert_allclose(positions, world.robot.home, atol=1e-6)
        arm = PushPlanner(world.robot).arm
        for joint in range(len(positions)):
            turned = positions.copy()
            turned[joint] += 0.02
            for _ in range(60):
                world.step(turned, np.zeros_like(speeds))
            reached, _ = world.joint_states()
            np.testing.assert_allclose(reached, turned, atol=2e-3)
            np.testing.assert_allclose(world.sample().tool, arm.tip(reached), atol=1e-4)


@pytest.mark.parametrize("robot", ROBOTS)
def test_from_beside_its_base_the_arm_comes_to_each_push(engine, robot, scene):
    cell = WorldConfig(robot=robot, wait_aside=True, full_motion=True)
    with World(nominal_parameters(), cell, engine) as world:
        world.reset(scene)
        for push in (PUSH, make_push(-0.3, 0.0, 0.05)):
            world.push(push)
            np.testing.assert_allclose(world.joint_states()[0], world._simulation.home, atol=1e-3)
