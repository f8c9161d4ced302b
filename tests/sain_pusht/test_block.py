"""The block and the frame are those of gym-pusht."""

import numpy as np
import pytest

from sain_core.scene import RADIUS
from sain_pusht.block import (
    BLOCK_RADIUS,
    goal_of,
    metres,
    pose_of,
    pusht_bodies,
    scene_of,
)
from sain_pusht.world import NEAR, TURNED, PushtWorld


@pytest.mark.parametrize("seed", [0, 3, 7])
def test_its_corners_are_those_of_gym_pusht(world: PushtWorld, seed: int) -> None:
    world.env.reset(seed=seed)
    pose = world.inner._get_info()["block_pose"]
    theirs = metres(world.inner.get_keypoints(world.inner._block_shapes))
    scene = scene_of(pose)
    ours = pusht_bodies().shapes[0].placed(scene[0])
    apart = np.linalg.norm(ours[:, None] - theirs, axis=-1)
    assert apart.min(axis=1).max() < 1e-4
    assert scene[0, RADIUS] == BLOCK_RADIUS
    turn = np.angle(np.exp(1j * (pose_of(scene) - pose)[2]))
    assert np.abs(pose_of(scene) - pose)[:2].max() < 1e-9
    assert abs(turn) < 1e-9


def test_a_block_at_the_goal_is_a_success_there(world: PushtWorld) -> None:
    world.reset(0)
    goal = goal_of(world.goal, 0.001, 0.01)
    scene = goal.placed(world.scene)
    pose = pose_of(scene)
    inner = world.inner
    inner.block.angle = float(pose[2])
    inner.block.position = tuple(pose[:2].tolist())
    assert inner._get_coverage() == pytest.approx(1.0, abs=1e-6)


def test_what_the_agent_takes_for_reached_is_a_success_there(world: PushtWorld) -> None:
    world.reset(0)
    goal = goal_of(world.goal, NEAR, TURNED).placed(world.scene)
    for bearing in np.linspace(0.0, 2 * np.pi, 12):
        for way in (-1.0, 1.0):
            off = goal.copy()
            off[0, :3] += [NEAR * np.cos(bearing), NEAR * np.sin(bearing), way * TURNED]
            pose = pose_of(off)
            world.inner.block.angle = float(pose[2])
            world.inner.block.position = tuple(pose[:2].tolist())
            assert world.inner._get_coverage() > 0.95
