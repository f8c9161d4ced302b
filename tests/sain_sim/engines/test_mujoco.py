"""What is said of MuJoCo's world, read back from MuJoCo."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shapely import Point, Polygon

from sain_core.errors import ConfigError
from sain_core.feasibility import Stroke
from sain_core.scene import DISK_HEIGHT, MID, TARGET, X
from sain_core.shapes.bodies import Role
from sain_core.world import DivergedError
from sain_sim.world.engines import MUJOCO
from sain_sim.world.parameters import nominal_parameters
from sain_sim.world.truth import TruthConfig
from sain_sim.world.workcell import GRAVITY, Watch
from sain_sim.world.world import World

pytest.importorskip("mujoco", reason="MuJoCo is not installed")

from sain_sim.engines.mujoco_description import PHYSICS_STEPS

NOMINAL = nominal_parameters()
LIMIT = 1e-3  # [m]


@pytest.fixture
def cell_world():
    with World(NOMINAL, engine=MUJOCO) as world:
        yield world


def test_numbers_are_those_of_the_sources(cell_world):
    model = cell_world._cell._model
    assert model.opt.timestep * PHYSICS_STEPS == pytest.approx(1 / 240)
    assert model.opt.timestep <= 0.002
    assert [model.actuator(n).trnid[0] for n in range(model.nu)] == list(range(7))
    assert np.allclose(model.opt.gravity, [0.0, 0.0, -GRAVITY])
    assert model.body("body0").mass[0] == NOMINAL.masses[0]
    inertia = NOMINAL.body_shapes[0].inertia(NOMINAL.masses[0], NOMINAL.radii[0])
    assert np.allclose(model.body("body0").inertia, inertia)


@pytest.mark.parametrize("shape", ["disk", "t", "l"])
def test_a_body_slides_straight_as_far_as_friction_lets_it(shape, bench):
    parameters = replace(nominal_parameters(shapes=("disk", shape)), friction=0.2)
    with World(parameters, engine=MUJOCO) as world:
        start = parameters.scene(np.array([[0.3, 0.4], [0.5, 0.0]]))
        world.reset(start)
        bench.kick(world, TARGET, (0.3, 0.0))
        assert world.settle()
        way = (world.observe() - start)[TARGET, :3]
    assert way[0] == pytest.approx(0.3**2 / (2 * 0.2 * GRAVITY), rel=0.03)
    assert np.abs(way[1:]).max() < 0.005


@pytest.mark.parametrize("shapes", [("disk", "disk"), ("t", "disk"), ("cube", "t"), ("star", "l")])
def test_bodies_that_press_on_each_other_stay_upright(shapes):
    """Where cylinders press on each other, MuJoCo lets them climb."""
    parameters, heights, tilts = nominal_parameters(shapes=shapes), [], []
    with World(parameters, engine=MUJOCO) as world:
        start = world.reset(parameters.scene(np.array([[0.45, 0.0], [0.63, 0.01]])))

        def look(_):
            poses = world._cell._poses
            heights.append(poses[:, 2].copy())
            tilts.append(poses[:, 4:6].copy())

        stroke = Stroke(np.array([0.33, 0.01]), np.array([0.56, 0.01]), 0.0)
        after = world.carry_out(stroke, Watch(look, 1), guarded=False).after
    assert np.abs(np.array(heights) - DISK_HEIGHT / 2).max() < 0.5 * LIMIT
    assert np.abs(np.array(tilts)).max() < 0.005
    assert (after - start)[TARGET, X] > 0.005


@pytest.mark.parametrize("shape", ["disk", "cube", "hexagon", "t", "star"])
def test_the_tool_touches_a_body_where_its_outline_is(shape):
    parameters, away = nominal_parameters(1, shapes=(shape,)), []
    turned = np.array([0.4])
    with World(parameters, engine=MUJOCO) as world:
        world.reset(parameters.scene(np.array([[0.45, 0.0]]), turned))

        def look(sample):
            ring = Polygon(parameters.body_shapes[0].placed(sample.scene[0])).exterior
            contact = world._cell._data.contact
            tool = world._cell._is_tool[contact.geom].any(axis=1)
            away.extend(ring.distance(Point(place[:2])) for place in contact.pos[tool])

        world.carry_out(Stroke(np.array([0.31, 0.01]), np.array([0.48, 0.01]), 0.0), Watch(look, 1))
    assert len(away) > 20
    assert max(away) < 0.5 * LIMIT  # contacts are of the step before: 0.3 mm at 0.2 m/s


def test_a_fixed_body_stays_and_stops_others(bench):
    parameters = replace(NOMINAL, roles=(Role.PUSHABLE, Role.FIXED))
    with World(parameters, engine=MUJOCO) as world:
        start = bench.touching(parameters)
        world.reset(start)
        bench.kick(world, MID, (0.5, 0.0))
        world.settle()
        after = world.observe()
    assert np.array_equal(after[TARGET], start[TARGET])
    assert after[MID, X] - start[MID, X] < 0.003


def test_effects_that_it_has_change_a_push_and_others_are_refused(bench):
    after = []
    for effects in ("none", "patches", "tilt", "mass", "feet", "rims"):
        truth = TruthConfig("rough", effects, engine=MUJOCO)
        parameters = truth.roughen(NOMINAL)
        with World(parameters, engine=MUJOCO) as world:
            start = bench.touching(parameters, bearing=0.2)
            assert np.allclose(world.reset(start), start, atol=1e-12)
            after.append(world.push(bench.straight).after)
    assert all(np.abs(one - after[0])[:, :3].max() > 1e-4 for one in after[1:])
    message = "engine mujoco cannot simulate direction; use engine bullet, or effects without"
    with pytest.raises(ConfigError, match=message):
        TruthConfig("rough", "mass,direction", engine=MUJOCO)
    rough = TruthConfig("rough", "tool").roughen(NOMINAL)
    with pytest.raises(ConfigError, match="engine mujoco cannot simulate tool"):
        World(rough, engine=MUJOCO)


def test_a_push_that_diverges_has_no_outcome_and_leaves_no_trace(
    cell_world, bench, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log where it is
    cell_world.reset(bench.touching())
    before, time = cell_world.observe(), cell_world.time

    def break_it(_):
        cell_world._cell._speeds[MID, 0] = np.nan

    with pytest.raises(DivergedError, match=r"MuJoCo found no solution of the push: .*BADQVEL"):
        cell_world.push(bench.straight, on_step=break_it)
    assert np.array_equal(cell_world.observe(), before) and cell_world.time == time
    assert cell_world.push(bench.straight).settled
    assert not list(Path(tmp_path).iterdir())
