"""The disk's controller is that of gym-pusht, and targets lead the disk where it should be."""

import numpy as np
import pytest

from sain_pusht.block import pixels
from sain_pusht.motion import Servo
from sain_pusht.world import PushtWorld


def test_it_predicts_the_disk_of_gym_pusht(world: PushtWorld) -> None:
    world.reset(1)
    random = np.random.default_rng(0)
    targets = random.uniform(0.1, 0.4, (6, 2))
    expected = world.arena.servo.follow(world.motion, targets)[9::10]
    for target, motion in zip(targets, expected, strict=True):
        _, _, _, _, info = world.env.step(pixels(target))
        world.note(info)
        assert world.motion == pytest.approx(motion, abs=1e-9)


def test_a_stop_is_met_exactly() -> None:
    servo = Servo()
    places = np.linspace([0.1, 0.1], [0.3, 0.2], 5)
    targets = servo.targets(np.array([[0.1, 0.1], [0.0, 0.0]]), places, {4: np.zeros(2)})
    last = servo.follow(np.array([[0.1, 0.1], [0.0, 0.0]]), targets)[-1]
    assert last[0] == pytest.approx([0.3, 0.2], abs=2e-5)
    assert last[1] == pytest.approx([0.0, 0.0], abs=5e-4)
