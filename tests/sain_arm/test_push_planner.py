"""Laws of planned ways: continuous, within limits, straight; and only the tool touches."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from shapely import Polygon

from sain_arm.planning.push_planner import STANDOFF, PushPlan, PushPlanner
from sain_arm.planning.timing import Trajectory
from sain_arm.planning.tool_ways import above, around
from sain_core.errors import BlockedError, SainError, UnreachableError
from sain_core.feasibility import Stroke
from sain_core.scene import DISK_HEIGHT, make_scene, unit
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene
from tests.sain_arm.conftest import Planned, planned_robot


def scene_of(planned: Planned, first: Any, second: Any) -> Scene:
    """A T and a disk."""
    return make_scene(np.array([first, second]), np.array([0.5, 0.5]), np.array(planned.radii))


def random_push(planned: Planned, seed: int) -> tuple[Stroke, Scene]:
    """Draw a push through the middle of the T, in reach, with the disk elsewhere."""
    random = np.random.default_rng(seed)
    radius = planned.radii[0]
    while True:
        place = planned.place(random, radius + 0.02)
        heading = random.uniform(-np.pi, np.pi)
        away, way = radius + 0.02, unit(np.asarray(heading))
        start = place - away * way
        end = start + random.uniform(0.02, radius) * way
        other = planned.place(random, 0.0)
        clear = np.linalg.norm(other - place) > 2 * radius + planned.radii[1]
        if clear and planned.reach.contains(np.stack([start, end])).all():
            return Stroke(start, end, heading, 0.2, 0), scene_of(planned, place, other)


def sampled(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """The joints and their speeds each millisecond."""
    times = np.arange(0.0, trajectory.duration, 1e-3)
    rows = [trajectory.at(time) for time in times]
    return np.array([row[0] for row in rows]), np.array([row[1] for row in rows])


def check_limits(planned: Planned, plan: PushPlan) -> None:
    robot = planned.robot
    for part in (plan.approach, plan.stroke):
        joints, speeds = sampled(part)
        assert (joints >= robot.lower - 1e-6).all()
        assert (joints <= robot.upper + 1e-6).all()
        assert (np.abs(speeds) <= robot.velocity).all()
        assert (np.abs(np.diff(joints, axis=0)) <= 1e-3 * robot.velocity).all()  # no jump
        steps = np.diff(part.velocities, axis=0) / np.diff(part.times)[:, None]
        assert (np.abs(steps) <= robot.acceleration).all()
        assert not part.velocities[[0, -1]].any()


def test_ways_of_random_pushes(planned):
    """Each begins where the one before ended."""
    joints, refused = planned.robot.home, []
    for seed in range(8):
        stroke, scene = random_push(planned, seed)
        try:
            plan = planned.planner.plan(stroke, scene, joints)
        except SainError as error:
            refused.append(error)
            continue
        np.testing.assert_allclose(plan.approach.positions[0], joints, atol=1e-9)
        np.testing.assert_allclose(plan.approach.positions[-1], plan.stroke.positions[0], atol=1e-6)
        check_limits(planned, plan)
        begin, end = plan.pushing
        times = np.linspace(begin, end, 40)
        tips = planned.planner.arm.tips(np.array([plan.stroke.at(time)[0] for time in times]))
        way = unit(np.asarray(stroke.heading))
        across = (tips[:, :2] - stroke.start) @ np.array([-way[1], way[0]])
        along = (tips[:, :2] - stroke.start) @ way
        assert np.abs(across).max() < 5e-4
        assert np.ptp(tips[:, 2]) < 5e-4
        assert along[-1] == pytest.approx(stroke.length, abs=5e-4)
        if stroke.length > 0.05:
            cruise = np.diff(along) / np.diff(times)
            assert cruise.max() == pytest.approx(stroke.speed, rel=0.05)
        joints = plan.stroke.positions[-1]
    assert len(refused) <= 1, refused


def after_a_stroke(planned: Planned, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Joints at both sides of the T, low: where a stroke ended, and where the next one begins."""
    stroke, scene = random_push(planned, seed)
    way = unit(np.asarray(stroke.heading))
    scene[0, :2] = stroke.start + (planned.radii[0] + 0.02) * way
    scene[1, :2] += 1.0
    far = replace(stroke, start=scene[0, :2] + (planned.radii[0] + 0.02) * way, end=stroke.end)
    low = planned.planner.config.tip_height
    places = [np.array([*place, low]) for place in (stroke.start, far.start)]
    tips = above(*places, planned.planner.config.raised, planned.robot.base, 0.01)
    joints = planned.planner.kinematics.follow(planned.robot.home, tips)
    planned.planner.home(scene, planned.robot.home)  # the bodies are there
    return joints[0], joints[-1]


def test_between_strokes_the_arm_does_not_rest_and_keeps_its_corridor(planned):
    """Along the table or above, the tool is always fast, and nothing but its end is near a body."""
    planner = planned.planner
    for seed in range(4):
        try:
            start, end = after_a_stroke(planned, seed)
            way = planner.travel(start, end, beside=0)
        except SainError:
            continue
        joints, _ = sampled(way)
        tips = planner.arm.tips(joints)
        body = Polygon(planner._outlines[0])
        gaps = shapely.distance(body, shapely.points(tips[:, :2])) - planned.robot.tool_radius
        assert (gaps[tips[:, 2] < DISK_HEIGHT] > 0.002).all()
        low = tips[:, 2].max() < 2 * planner.config.tip_height
        assert np.ptp(tips[:, 2]) < 5e-4 if low else tips[:, 2].max() > DISK_HEIGHT + 0.005
        speed = np.linalg.norm(np.diff(tips, axis=0), axis=1) / 1e-3
        assert speed[50:-50].min() > 0.05, "a rest on the way"


def test_a_near_place_on_the_same_side_is_reached_along_the_table(planned):
    stroke, scene = random_push(planned, 0)
    way = unit(np.asarray(stroke.heading))
    plan = planned.planner.plan(stroke, scene, planned.robot.home)
    scene[0, :2] += 0.01 * way
    aside = stroke.start - 0.005 * way + 0.03 * np.array([-way[1], way[0]])
    low = planned.planner.config.tip_height
    joints = plan.stroke.positions[0]
    end = planned.planner.kinematics.follow(joints, np.array([[*aside, low]]))[-1]
    planned.planner.home(scene, planned.robot.home)  # the bodies are there
    tips = planned.planner.arm.tips(planned.planner.travel(joints, end).positions)
    assert np.ptp(tips[:, 2]) < 5e-4
    np.testing.assert_allclose(tips[-1], [*aside, low], atol=1e-4)


def test_a_tool_between_bodies_goes_around_them_or_not_at_all():
    """A wall of two boxes with a slit: too narrow, around; shut in: there is no way."""
    box = np.array([[-0.02, -0.1], [0.02, -0.1], [0.02, 0.1], [-0.02, 0.1]])
    start, end = np.array([-0.1, 0.0]), np.array([0.1, 0.0])
    walls = [box + side * np.array([0.0, 0.115]) for side in (-1.0, 1.0)]
    wide, narrow = (np.array([[-0.5, 0.5], [-y, y]]) for y in (0.5, 0.2))
    way = around(start, end, walls, 0.012, wide)
    gaps = [Polygon(wall).distance(shapely.LineString(way)) - 0.012 for wall in walls]
    assert min(gaps) > 0.0039 and len(way) > 3
    assert around(start, end, walls, 0.012, narrow) is None
    slit = around(start, end, walls, 0.010, narrow)
    np.testing.assert_allclose(slit, [start, end])


def test_a_body_in_the_way_of_the_lowered_tool_is_named(ur5):
    stroke, scene = random_push(ur5, 0)
    scene[1, :2] = stroke.start
    with pytest.raises(BlockedError, match="the tool would touch body 1 on its way"):
        ur5.planner.plan(stroke, scene, ur5.robot.home)


@pytest.mark.parametrize(
    ("start", "speed", "text"),
    [
        ((1.5, 0.0), 0.2, r"would stroke at x = 1.500 m; the workspace allows 0.16 to 1 m"),
        ((0.97, 0.55), 0.2, r"no inverse kinematics at \(0.970, 0.550, 0.060\) m"),
        ((0.5, 0.0), 40.0, r"the joints allow \d\.\d+ m/s in this stroke; 40 m/s is asked for"),
    ],
)
def test_what_the_arm_cannot_do_is_refused(ur5, start, speed, text):
    start = np.array(start)
    stroke = Stroke(start, start + np.array([0.02, 0.0]), 0.0, speed, 0)
    with pytest.raises(UnreachableError, match=text):
        ur5.planner.plan(stroke, scene_of(ur5, (0.5, 0.4), (0.4, -0.4)), ur5.robot.home)


def test_from_another_posture_of_the_arm_a_push_is_still_planned(ur5):
    """The other elbow: the way goes over in joint space."""
    stroke, scene = random_push(ur5, 2)
    other = ur5.robot.home + np.array([0.0, 0.9, -1.8, 0.9, 0.0, 0.0])
    check_limits(ur5, ur5.planner.plan(stroke, scene, other))


def test_an_arm_that_waits_aside_is_raised_over_high_bodies():
    panda = planned_robot("paper_panda")
    high = Bodies.named(("t", "disk"), heights=(0.08, DISK_HEIGHT))
    planner, aside = PushPlanner(panda.robot, high, panda.radii), panda.robot.aside(1.5)
    assert planner.arm.tip(aside)[2] < planner.config.raised
    stroke, scene = random_push(panda, 2)
    plan = planner.plan(stroke, scene, aside)
    np.testing.assert_allclose(plan.approach.positions[0], aside, atol=1e-9)
    highest = planner.arm.tips(plan.approach.positions)[:, 2].max()
    assert highest > planner.config.raised - 0.002


def test_a_retreat_goes_straight_up(planned):
    stroke, scene = random_push(planned, 1)
    plan = planned.planner.plan(stroke, scene, planned.robot.home)
    low = plan.stroke.at(plan.pushing[1] / 2)[0]
    tips = planned.planner.arm.tips(planned.planner.retreat(low).positions)
    assert np.ptp(tips[:, :2], axis=0).max() < 5e-4
    assert tips[-1, 2] == pytest.approx(planned.planner.config.raised, abs=5e-4)


def test_the_table_of_reach_holds_for_other_places_too(planned):
    """Of pushes whose way lies in the table hardly one is refused."""
    planner, refused = PushPlanner(planned.robot), 0
    for seed in range(12):
        random = np.random.default_rng(100 + seed)
        while True:
            start, heading = planned.place(random, 0.0), random.uniform(-np.pi, np.pi)
            way = unit(np.asarray(heading))
            if planned.reach.covers(start, way, np.asarray(0.06)):
                break
        try:
            stroke = Stroke(start, start + 0.06 * way, heading, 0.2, 0)
            planner.plan(stroke, np.zeros((0, 8)), planned.robot.home)
        except SainError:
            refused += 1
    assert refused <= 1


def test_a_tool_that_stopped_at_the_table_lifts_off(ur5):
    """As after a stop while it was lowered: where it brakes it may touch the table."""
    stroke, scene = random_push(ur5, 0)
    low = ur5.planner.plan(stroke, scene, ur5.robot.home).approach.positions[-1]
    tip = ur5.planner.arm.tip(low)
    touching = ur5.planner.kinematics.follow(low, np.array([tip, [*tip[:2], 0.0005]]))[-1]
    plan = ur5.planner.plan(stroke, scene, touching)
    np.testing.assert_allclose(plan.approach.positions[0], touching, atol=1e-9)


def test_the_way_ahead_ends_behind_the_next_stroke_or_high_above_and_keeps_away(planned):
    """Whatever is expected, the body is not touched; the next stroke begins from there."""
    planner, ends = planned.planner, []
    for seed in range(4):
        stroke, scene = random_push(planned, seed)
        plan = planner.plan(stroke, scene, planned.robot.home)
        scene[0, :2] += (stroke.length - 0.005) * unit(np.asarray(stroke.heading))
        for turn in (0.5, 3.0):
            heading = stroke.heading + turn
            start = scene[0, :2] - (planned.radii[0] + 0.025) * unit(np.asarray(heading))
            following = replace(stroke, start=start, end=start + 0.03 * unit(np.asarray(heading)))
            following = replace(following, heading=heading)
            try:
                way = planner.ahead(following, scene, plan.stroke.positions[-1])
            except SainError:
                continue
            tips = planner.arm.tips(sampled(way)[0])
            gaps = shapely.distance(Polygon(planner._outlines[0]), shapely.points(tips[:, :2]))
            low = tips[:, 2] < DISK_HEIGHT
            away = np.linalg.norm(tips[:, :2] - tips[0, :2], axis=1) > 0.01
            assert (gaps[low & away] > planned.robot.tool_radius + 0.002).all()
            behind = start - STANDOFF * unit(np.asarray(heading))
            np.testing.assert_allclose(tips[-1, :2], behind, atol=1e-3)
            ends.append(tips[-1, 2])
    assert ends
