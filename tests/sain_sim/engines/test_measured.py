"""What a measured laboratory draws is within its range, and reaches MuJoCo."""

from dataclasses import replace

import numpy as np
import pytest
from shapely import MultiPoint, Polygon

from sain_core.errors import ConfigError
from sain_core.push import SPEED, make_push
from sain_core.scene import MID, POSITION, THETA
from sain_core.shapes.library import get_shape
from sain_core.shapes.shape import FLAT
from sain_sim.world.engines import MUJOCO
from sain_sim.world.parameters import WorldParameters, nominal_parameters
from sain_sim.world.roughness import Roughness
from sain_sim.world.truth import MEASURED, TruthConfig
from sain_sim.world.workcell import GRAVITY
from sain_sim.world.world import World
from tests.hexagon import SOME

pytest.importorskip("mujoco", reason="MuJoCo is not installed")

ONE = nominal_parameters(1)
PLACE = np.array([[0.45, 0.0]])
LABS = [TruthConfig(MEASURED, lab=lab, engine=MUJOCO) for lab in range(6)]


def measured(parameters: WorldParameters = ONE, bottom="feet", **values) -> WorldParameters:
    return replace(parameters.on(bottom), roughness=Roughness(**values))


def pushed(parameters, push, place=PLACE, watch=None):
    """Return what a push changes of the pose (3,) of a single body."""
    with World(parameters, engine=MUJOCO) as world:
        before = world.reset(parameters.scene(place))
        look = None if watch is None else lambda sample: watch(world, sample)
        return (world.push(push, on_step=look).after - before)[MID, : THETA + 1]


def test_labs_differ_and_are_within_their_ranges():
    drawn = [lab.roughen(nominal_parameters(2)) for lab in LABS]
    assert len({one.roughness for one in drawn}) == len({one.tool_friction for one in drawn}) == 6
    for one in drawn:
        rough = one.roughness
        assert one.bottom == FLAT
        assert 0.1 <= one.friction <= 0.3 and 0.12 <= one.tool_friction <= 0.31
        assert max(np.hypot(*offset) for offset in rough.mass_offsets) <= 0.15
        assert np.hypot(*rough.tool_offset) <= 0.002
        assert all(0.004 <= time <= 0.02 for time in rough.contact_times)
        assert all(0.5 <= spread <= 1.3 for spread, *_ in rough.pressures)
        grid = np.meshgrid(np.linspace(0.16, 1.16, 30), np.linspace(-0.6, 0.6, 30))
        factors = [rough.friction_factor(x, y) for x, y in np.reshape(grid, (2, -1)).T]
        assert max(factors) / min(factors) == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize("name", SOME)
def test_all_shapes_lie_on_supports_within_their_outline(name):
    for lab in LABS:
        made = lab.roughen(WorldParameters((8.0,), (0.06,), (name,)))
        outline = Polygon(get_shape(name).outline(0.06)).convex_hull.buffer(1e-6)
        supports = MultiPoint(made.supports(0))
        assert outline.covers(supports)
        assert supports.convex_hull.covers(MultiPoint(made.mass_offsets))
        assert made.loads(0).sum() == pytest.approx(1.0)


def test_a_body_stops_as_far_as_the_friction_of_its_place_lets_it(bench):
    patches = ((2 * np.pi, 0.0, -2 * np.pi * 0.4),)  # most friction at x = 0.4, least at 0.9
    parameters = measured(patches=patches, patch_depth=np.log(2.0) / 2.0)
    for x, factor in ((0.4, np.sqrt(2.0)), (0.9, 1.0 / np.sqrt(2.0))):
        with World(parameters, engine=MUJOCO) as world:
            world.reset(parameters.scene(np.array([[x, 0.0]])))
            bench.kick(world, MID, (0.0, 0.2))
            assert world.settle()
            way = world.observe()[MID, 1]
        expected = 0.2**2 / (2.0 * factor * parameters.friction * GRAVITY)
        assert way == pytest.approx(expected, rel=0.05)


def test_uneven_pressure_turns_what_is_pushed_through_its_middle():
    turns = []
    for heavy in (1.0, 6.0):
        even = Roughness().supports(0, ONE.body_shapes[0])[0]
        weights = tuple(np.where(even[:, 1] > 0.1, heavy, 1.0).tolist())
        parameters = measured(bottom=FLAT, pressures=((1.0, *weights),))
        push = make_push(0.0, 0.0, 0.08)
        push[SPEED] = 0.05
        turns.append(abs(float(pushed(parameters, push)[THETA])))
        assert parameters.loads(0).max() == pytest.approx(heavy / sum(weights))
    assert turns[0] < 0.02
    with pytest.raises(ConfigError, match="feet have no pressure to be drawn"):
        measured(pressures=((1.0, *(1.0,) * 9),))


@pytest.mark.parametrize("pair", [0, 1])
def test_soft_contacts_let_the_tool_or_another_body_in(pair):
    """The tool presses on a disk, and that on another one, of 20 kg."""
    deep = []
    for time in (0.0, 0.004, 0.02):
        times = (time, 0.0) if pair == 0 else (0.0, time)
        parameters = measured(
            replace(nominal_parameters(), masses=(8.0, 20.0)), contact_times=times
        )
        found = [0.0]

        def look(world, _, found=found):
            contact = world._cell._data.contact
            tool = world._cell._is_tool[contact.geom].any(axis=1)
            bodies = world._cell._body_of[contact.geom].min(axis=1) >= 0
            found.extend(-contact.dist[tool if pair == 0 else bodies])

        places = np.array([[0.45, 0.0], [0.5905, 0.0]])
        pushed(parameters, make_push(0.0, 0.0, 0.1), places, look)
        deep.append(max(found))
    assert deep[2] > 3.0 * deep[1] and deep[1] > deep[0]
    assert 5e-4 < deep[2] < 4e-3


def test_the_tool_is_off_by_its_offset_and_its_joints_do_not_tell():
    offset, places = (0.0015, -0.001), []
    pushed(
        measured(tool_offset=offset),
        make_push(0.0, 0.0, 0.05),
        np.array([[0.45, 0.2]]),
        lambda _, sample: places.append(sample.tool - sample.commanded_tool),
    )
    assert np.allclose(np.mean(places, axis=0)[:2], offset, atol=2e-4)
    with World(measured(tool_offset=offset), engine=MUJOCO) as world:
        arm = world._cell.arm
        assert np.allclose(arm.tool()[:2] - arm.tip()[:2], offset, atol=1e-6)


def test_equal_pushes_come_out_equal_and_repeats_scatter():
    """Repeats of the real pushes are 1.7 mm and 2.2 degrees from their mean in 50 mm of travel."""
    lab, ends = replace(LABS[1], effects="pressure,noise"), []
    parameters = lab.roughen(WorldParameters((8.0,), (0.065,), ("hexagon",)))
    push = make_push(0.3, 0.2, 0.055)
    push[SPEED] = 0.05
    for repeat in (0, 0, *range(1, 8)):
        noisy = replace(parameters.roughness, repeat=repeat)
        ends.append(pushed(replace(parameters, roughness=noisy), push))
    assert np.array_equal(ends[0], ends[1])
    away = np.array(ends[1:]) - np.mean(ends[1:], axis=0)
    assert 0.0005 < np.hypot(*away[:, POSITION].T).mean() < 0.004
    assert 0.005 < np.abs(away[:, THETA]).mean() < 0.08
    other = pushed(parameters, push, PLACE + 1e-9)  # another push: another draw
    assert np.abs(other - ends[0])[POSITION].max() > 1e-5
