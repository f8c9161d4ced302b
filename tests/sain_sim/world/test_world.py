"""What is true of a push in each engine."""

import dataclasses
import importlib
from math import pi

import numpy as np
import pytest

from sain_core.errors import SainError, UnreachableError
from sain_core.push import SPEED, make_push
from sain_core.scene import MID, POSITION, RADIUS, TARGET, Y, is_settled, unit
from sain_core.shapes.solids import DISK
from sain_core.world import DivergedError, check_possible
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.shadow import DYNAMICS, Bullet, BulletPrior
from sain_sim.world.start import paper_start
from sain_sim.world.workcell import TIME_STEP, WorldConfig
from sain_sim.world.world import World
from tests.workspace.source_tree import PYPROJECT

FULL = WorldConfig(full_motion=True)


def test_a_push_moves_the_target_and_ends_at_rest(world, bench):
    world.reset(bench.touching())
    outcome = world.push(bench.straight)
    moved = outcome.after[TARGET, POSITION] - outcome.before[TARGET, POSITION]
    assert 0.08 < moved[0] < 0.15
    assert abs(moved[1]) < 0.01
    assert outcome.settled and is_settled(outcome.after) and not outcome.fallen.any()
    assert np.array_equal(outcome.after, world.observe())
    assert 0.5 < outcome.duration == pytest.approx(world.time)


@pytest.mark.parametrize("shape", [DISK, "cube"])
def test_sliding_disks_obey_coulomb(shape, bench, engine):
    parameters = nominal_parameters()
    parameters = dataclasses.replace(parameters, shapes=(DISK, shape), friction=0.2)
    with World(parameters, engine=engine) as world:
        world.reset(bench.touching(parameters))
        outcome = world.push(bench.towards(0.0, 0.15))
    beyond = outcome.after[TARGET, 0] - outcome.after[MID, 0] - sum(parameters.radii)
    assert -0.001 < beyond < 0.2**2 / (2 * 0.2 * 9.81)  # at most a free slide from 0.2 m/s


@pytest.mark.parametrize("speed", [0.02, 0.2, 0.4])
def test_the_tool_travels_at_the_speed_of_the_push(world, bench, speed):
    world.reset(bench.touching())
    seen = []
    push = bench.straight.copy()
    push[SPEED] = speed
    world.push(push, on_step=seen.append)
    tool = np.array([sample.commanded_tool for sample in seen if sample.phase == "push"])
    steps = np.linalg.norm(np.diff(tool, axis=0), axis=1) / TIME_STEP
    assert steps.max() == pytest.approx(speed, rel=0.02)


def episode(world, bench, observer=None, seed=4, count=3):
    """Push some times; return every scene, and what was refused."""
    parameters, start = bench.drawn(seed, count)
    world.reset(start, parameters)
    scenes, refused = [], []
    for push in bench.pushes(seed, start, 4):
        try:
            scenes.append(world.push(push, on_step=observer).after)
        except SainError as error:
            refused.append(str(error))
    return np.array(scenes), refused


@pytest.mark.parametrize("config", [WorldConfig(), FULL], ids=["short", "full"])
def test_worlds_repeat_bit_for_bit_fresh_used_or_watched(config, bench, engine):
    worlds = (World(nominal_parameters(n), config, engine=engine) for n in (3, 2))
    with next(worlds) as first, next(worlds) as used:
        episode(used, bench, seed=9)
        scenes, refused = episode(first, bench)
        assert len(scenes) >= 2
        for world, observer in ((used, None), (first, lambda sample: None)):
            again, refused_again = episode(world, bench, observer)
            assert np.array_equal(again, scenes)
            assert refused_again == refused


@pytest.mark.parametrize("config", [WorldConfig(), FULL], ids=["short", "full"])
def test_the_tool_follows_its_line_and_touches_the_mid_disk_alone(config, bench, engine):
    along, pushed = [], 0
    with World(nominal_parameters(), config, engine=engine) as world:
        for seed in range(2):
            parameters, start = bench.drawn(seed, 4)
            world.reset(start, parameters)
            for push in bench.pushes(seed, start, 6):
                samples = []
                try:
                    world.push(push, on_step=samples.append)
                except SainError:
                    continue
                pushed += 1
                radius = world.config.feasibility.limits.tool_radius
                for sample in samples:
                    others = sample.scene[1:]
                    apart = np.hypot(*(others[:, POSITION] - sample.tool[:2]).T)
                    low = sample.tool[2] < 0.04
                    assert not low or (apart - others[:, RADIUS] - radius).min() > -1e-4
                    if sample.phase == "push":
                        along.append(np.abs(sample.tool - sample.commanded_tool).max())
    assert pushed >= 3
    assert np.percentile(along, 99) < 1.5e-3


def test_a_disk_that_falls_off_the_table_is_an_outcome(bench, engine):
    table = dataclasses.replace(WorldConfig().feasibility.table, x_max=0.66)
    feasibility = dataclasses.replace(WorldConfig().feasibility, table=table)
    config = WorldConfig(feasibility=feasibility)
    with World(nominal_parameters(), config, engine=engine) as world:
        world.reset(bench.touching())
        outcome = world.push(bench.towards(0.0, 0.15))
        assert outcome.fallen.any()
        assert outcome.fallen.tolist() == [False, True]
        assert outcome.settled  # what lies on the floor does not count


def test_mirrored_pushes_have_mirrored_outcomes(world, bench):
    """Up to MuJoCo's arm, which yields a little and whose masses are not mirrored."""
    for bearing, location, angle in [(0.3, 0.0, 0.2), (0.1, 0.2, -0.3)]:
        ends = []
        for side in (1.0, -1.0):
            world.reset(bench.touching(bearing=side * bearing))
            after = world.push(make_push(side * location, side * angle, 0.1)).after
            ends.append(after[:, :3] * [1.0, side, side])
        assert np.abs(ends[0] - ends[1])[:, :2].max() < 1.5e-3
        assert np.abs(ends[0] - ends[1])[:, 2].max() < 0.03


def test_turning_scene_and_push_turns_the_outcome(engine):
    """Up to Bullet's friction, which knows the world's axes, and to MuJoCo's yielding arm."""
    off = []
    for bearing, location, angle in [(0.3, 0.0, 0.2), (-0.4, -0.1, 0.0), (0.1, 0.5, -0.3)]:
        ends = []
        for turn in np.arange(4) * pi / 4:
            parameters = nominal_parameters()
            mid = np.array([0.52, 0.0])
            target = mid + (sum(parameters.radii) + 0.001) * unit(np.asarray(bearing + turn))
            scene = parameters.scene(np.stack([mid, target]), np.array([1.0, 2.0]) + turn)
            with World(parameters, engine=engine) as world:
                world.reset(scene)
                after = world.push(make_push(location + turn, angle, 0.08)).after
            away = after[:, POSITION] - mid
            ends.append(np.stack([away @ unit(np.asarray(turn + a)) for a in (0.0, pi / 2)], -1))
        off.append(np.linalg.norm(ends - np.mean(ends, axis=0), axis=-1))
    assert np.mean(off) < 0.0015


PUSH = make_push(0.0, 0.0, 0.10)


def test_the_tool_goes_where_the_body_is_taken_to_be(world):
    after = []
    for shift in (None, 0.0, 0.004):
        start = world.reset(paper_start(world.parameters))
        seen = None if shift is None else start.copy()
        if seen is not None:
            seen[MID, Y] += shift
        after.append(world.push(PUSH, seen=seen).after)
    exact, straight, aside = after
    np.testing.assert_allclose(straight, exact, atol=2e-3)  # a longer run-up, no more
    assert aside[TARGET, Y] < straight[TARGET, Y] - 1e-3  # pushed on its left, it goes right


@pytest.mark.parametrize("speed", [60.0, float("nan")])
def test_a_push_that_explodes_has_no_outcome(world, bench, speed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log where it is
    world.reset(bench.touching())
    before, time = world.observe(), world.time

    def explode(_):
        bench.kick(world, TARGET, (speed, 0.0))

    with pytest.raises(DivergedError, match=r"found no solution of the push: "):
        world.push(bench.straight, on_step=explode)
    assert np.array_equal(world.observe(), before) and world.time == time
    assert world.push(bench.straight).settled


def test_the_body_and_what_is_possible_are_named(bench):
    before = bench.touching()
    check_possible(before, before)
    after = before.copy()
    after[TARGET, 0] += 30.0
    with pytest.raises(
        DivergedError, match=r"body 1 would end 30 m from where .* possible are 2 m"
    ):
        check_possible(before, after)


def test_every_name_is_offered_and_gives_its_kind():
    entries = PYPROJECT["project"]["entry-points"]["sain.dynamics"]
    offered = {name: target for name, target in entries.items() if target.startswith("sain_sim")}
    assert set(offered) == set(DYNAMICS) == {"bullet", "bullet_measured"}
    for name, target in offered.items():
        module, function = target.split(":")
        with getattr(importlib.import_module(module), function)(name) as bullet:
            assert bullet.kind == DYNAMICS[name]


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
