"""MuJoCo with so many bodies that sparse Jacobians, its default there, would be wrong."""

import numpy as np
import pytest

from sain_core.push import make_push
from sain_core.scene import make_scene
from sain_sim.world.world import World, WorldParameters

mujoco = pytest.importorskip("mujoco")
DENSE = mujoco.mjtJacobian.mjJAC_DENSE
NEAR = np.array([[0.40, -0.35], [0.55, -0.35], [0.70, -0.35], [0.85, -0.35]])  # a row, 3 cm apart
FAR = np.array([[0.40 + 0.15 * i, y] for y in (-0.1, 0.1) for i in range(4)])


def pushed(places: np.ndarray) -> tuple[np.ndarray, World]:
    """Push the first of some disks against the next ones; return where all come to rest."""
    count = len(places)
    scene = make_scene(places, np.full(count, 8.0), np.full(count, 0.06))
    world = World(WorldParameters.of_scene(scene, 0.12), engine="mujoco")
    world.reset(scene)
    return world.push(make_push(0.0, 0.0, 0.10)).after, world


def test_bodies_that_are_far_change_nothing():
    """Twelve bodies are 79 degrees of freedom; four are 31."""
    four, _ = pushed(NEAR)
    twelve, _ = pushed(np.concatenate([NEAR, FAR]))
    assert np.abs(four[:3, :2] - NEAR[:3]).max() > 0.02
    np.testing.assert_allclose(twelve[:4, :3], four[:, :3], atol=1e-5)
    np.testing.assert_allclose(twelve[4:, :2], FAR, atol=1e-5)


def test_jacobians_are_dense_and_accelerations_those_of_few_bodies():
    from sain_sim.engines.mujoco_description import describe_world

    _, world = pushed(np.concatenate([NEAR, FAR]))
    config = world.config
    model = describe_world(config, world.parameters)
    assert model.nv > 60 and model.opt.jacobian == DENSE
