"""Bullet by name, as `sain_core.model` finds it, and where its arm does not reach."""

import importlib

import numpy as np
import pytest

from sain_core.errors import ConfigError, UnreachableError
from sain_core.scene import POSITION, TARGET
from sain_sim.world.shadow import DYNAMICS, Bullet, BulletPrior, load_bullet
from tests.workspace.source_tree import setup_arguments


def test_every_name_is_offered_and_gives_its_kind():
    lines = setup_arguments("sain_sim")["entry_points"]["sain.dynamics"]
    offered = dict(line.split(" = ") for line in lines)
    assert set(offered) == set(DYNAMICS) == {"bullet", "bullet_measured"}
    for name, target in offered.items():
        module, function = target.split(":")
        with getattr(importlib.import_module(module), function)(name) as bullet:
            assert bullet.kind == DYNAMICS[name]


def test_it_predicts_as_the_shadow_of_its_kind_does(bench):
    _, start = bench.drawn(4)
    way = start[TARGET, POSITION] - start[0, POSITION]
    push = bench.towards(np.arctan2(way[1], way[0]))
    for name, kind in DYNAMICS.items():
        with load_bullet(name) as bullet, BulletPrior(kind) as shadow:
            expected = shadow.predict(start, push)
            assert np.array_equal(bullet.step(start[None], push[None])[0], expected)
            assert not np.array_equal(expected, start) and bullet.refused == 0


def test_a_push_out_of_reach_moves_nothing_and_is_counted(bench):
    near = bench.touching()
    far = near.copy()
    far[:, POSITION] += [1.0, 0.0]
    pushes = np.stack([bench.straight] * 3)
    with Bullet() as bullet:
        expected = bullet.predict(near, bench.straight)
        with pytest.raises(UnreachableError):
            BulletPrior.predict(bullet, far, bench.straight)
        predicted = bullet.step(np.stack([far, near, far]), pushes)
        assert bullet.refused == 2
    assert np.array_equal(predicted, np.stack([far, expected, far]))


def test_another_name_is_refused():
    with pytest.raises(ConfigError, match="no dynamics 'bulet' in the simulator"):
        load_bullet("bulet")
