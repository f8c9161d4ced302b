"""Each effect does to disks and tool what it does on a real table, and nothing when it is off."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from sain_core.errors import BlockedError
from sain_core.push import make_push
from sain_core.scene import MID, POSITION, TARGET, THETA, is_settled, unit
from sain_core.shapes.shape import REGULAR_FEET
from sain_sim.world.parameters import WorldParameters, nominal_parameters
from sain_sim.world.roughness import PATCH_DEPTH, Roughness
from sain_sim.world.truth import LABS, ROUGH, TILT, draw_effects, effects_of
from sain_sim.world.workcell import GRAVITY
from sain_sim.world.world import World

MIDDLE = np.array([0.5, 0.0])


def draw_roughness(lab: int, effects: tuple[str, ...], count: int, world=ROUGH) -> Roughness:
    return draw_effects(world, lab, effects, count)["roughness"]


def rough(**values) -> WorldParameters:
    return replace(nominal_parameters(), roughness=Roughness(**values))


def beside(x: float, y: float) -> np.ndarray:
    """Return places (2, 2) of a mid disk and a target so far from it."""
    return MIDDLE + np.array([[0.0, 0.0], [x, y]])


def pushed(parameters, heading=0.0, middle=MIDDLE, headings=None, length=0.12, angle=0.0):
    """Return how far mid disk and target (2, 2) got along and across a push through both."""
    way, left = unit(np.asarray(heading)), unit(np.asarray(heading + pi / 2))
    apart = sum(parameters.radii[:2]) + 0.001
    scene = parameters.scene(np.stack([middle, middle + apart * way]), headings)
    with World(parameters) as world:
        world.reset(scene)
        outcome = world.push(make_push(heading, angle, length))
        assert outcome.settled
    moved = outcome.after[:, POSITION] - scene[:, POSITION]
    return np.stack([moved @ way, moved @ left], axis=-1)


def slide(parameters, heading):
    """Return how far (2,) a target gets that is let go at 0.3 m/s along a heading."""
    scene = parameters.scene(beside(-0.2, 0.0)[::-1])
    with World(parameters) as world:
        world.reset(scene)
        body = world._cell.bodies[TARGET].id
        world._simulation.client.resetBaseVelocity(body, [*(0.3 * unit(np.asarray(heading))), 0.0])
        assert world.settle()
        return (world.observe() - scene)[TARGET, POSITION]


def test_no_effect_is_the_same_world_to_the_bit(bench):
    regular = Roughness(mass_offsets=((0.0, 0.0),) * 2, feet=(REGULAR_FEET,) * 2)
    after = []
    for roughness in (Roughness(), regular, draw_roughness(3, (), 2)):
        parameters = replace(nominal_parameters(), roughness=roughness)
        with World(parameters) as world:
            world.reset(bench.touching())
            after.append(world.push(bench.towards(0.1)).after)
    assert np.array_equal(after[0], after[1]) and np.array_equal(after[0], after[2])


def test_each_disk_has_the_friction_of_its_own_place():
    """Side by side, one on a crest of the friction and one in a trough, both slide along y."""
    places = np.array([[0.4, 0.0], [0.6, 0.0]])
    for phase in (0.0, pi):
        along = 2 * pi / 0.4
        parameters = rough(patches=((along, 0.0, phase - along * places[0, 0]),))
        with World(parameters) as world:
            world.reset(parameters.scene(places))
            for disk in world._cell.bodies:
                world._simulation.client.resetBaseVelocity(disk.id, [0.0, 0.2, 0.0])
            assert world.settle()
            ways = world.observe()[:, 1]
        crest, trough = ways if phase == 0.0 else ways[::-1]
        assert trough / crest == pytest.approx(np.exp(2 * PATCH_DEPTH), rel=0.1)


def test_grain_makes_it_harder_to_slide_along_x():
    parameters = rough(grain=0.6)
    along, across = (np.hypot(*slide(parameters, heading)) for heading in (0.0, pi / 2))
    assert across / along == pytest.approx(1 / 0.6, rel=0.05)
    even = np.hypot(*slide(nominal_parameters(), 0.0))
    assert along < even < across


def test_a_tilted_table_pulls_downhill_and_holds_what_rests():
    steep = TILT[1]
    parameters = replace(rough(tilt=(0.0, steep)), friction=0.08)
    level, tilted = pushed(nominal_parameters()), pushed(parameters)
    assert tilted[TARGET, 1] > level[TARGET, 1] + 0.001
    scene = parameters.scene(beside(0.2, 0.0))
    with World(parameters) as world:
        world.reset(scene)
        after = world.push(make_push(0.0, 0.3, 0.08)).after
        for _ in range(5 * 240):
            world._cell._step("rest", None, pushed=None)
        crept = np.linalg.norm(world.observe()[:, POSITION] - after[:, POSITION], axis=-1)
        assert is_settled(world.observe()) and crept.max() < 2e-4
    pull = np.array(Roughness(tilt=(0.01, -0.02)).gravity(GRAVITY))
    assert np.linalg.norm(pull) == pytest.approx(GRAVITY)
    assert pull[0] > 0.0 > pull[1]


@pytest.mark.parametrize("stiffness", [2000.0, 4000.0])
def test_a_soft_tool_lags_by_what_its_spring_gives(stiffness):
    parameters = rough(tool_stiffness=stiffness)
    scene = parameters.scene(beside(0.141, 0.0))
    samples = []
    with World(parameters) as world:
        world.reset(scene)
        world.push(make_push(0.0, 0.0, 0.15), on_step=samples.append)
    lags = np.array([(sample.commanded_tool - sample.tool)[0] for sample in samples])
    load = 0.12 * GRAVITY * 16.0 / stiffness  # both disks slide
    assert np.median(lags[90:170]) == pytest.approx(load, rel=0.2)
    assert np.abs(lags).max() < 0.02


def test_stock_joints_cannot_hold_an_impact():
    """The arm of the other worlds is where it should be whatever it meets; this one lags."""
    lags, gaps = [], []
    for parameters in (nominal_parameters(), rough(stock_joints=True)):
        samples = []
        with World(parameters) as world:
            world.reset(parameters.scene(beside(0.141, 0.0)))
            world.push(make_push(0.0, 0.0, 0.15), on_step=samples.append)
            tool_radius = world.config.feasibility.limits.tool_radius
        lags.append(max(float(np.abs(s.tool - s.commanded_tool).max()) for s in samples))
        apart = [np.linalg.norm(s.tool[:2] - s.scene[MID, POSITION]) for s in samples]
        gaps.append(min(apart) - tool_radius - parameters.radii[MID])
    assert lags[0] < 1e-4 and 2e-3 < lags[1] < 1.5e-2
    assert min(gaps) > -1.5e-3  # it is pushed back, it does not sink into the disk


def test_rough_rims_take_the_target_along():
    """A mid disk that passes a target drags its rim with it, the more the rougher it is."""
    ways = []
    for rim_friction in (0.12, 0.4):
        parameters = replace(nominal_parameters(), rim_friction=rim_friction)
        target = MIDDLE + (sum(parameters.radii) + 0.001) * unit(np.asarray(1.0))
        scene = parameters.scene(np.stack([MIDDLE, target]))
        with World(parameters) as world:
            world.reset(scene)
            after = world.push(make_push(0.0, 0.0, 0.12)).after
        ways.append((after - scene)[TARGET, 0])
    assert ways[1] > ways[0] + 0.005


def episode(world, bench, lab):
    parameters, start = bench.drawn(5)
    parameters = replace(parameters, roughness=draw_roughness(lab, effects_of(ROUGH), 2))
    world.reset(start, parameters)
    scenes = []
    for push in bench.pushes(5, start, 5):
        try:
            scenes.append(world.push(push).after)
        except BlockedError:
            scenes.append(world.observe())
    return np.array(scenes)


def test_rough_worlds_repeat_fresh_or_used_beside_others(bench):
    with World(nominal_parameters()) as first, World(nominal_parameters(3)) as used:
        scenes = episode(first, bench, 1)
        other = episode(used, bench, 2)
        assert np.array_equal(episode(used, bench, 1), scenes)
        assert not np.array_equal(other, scenes)
        used.reset(bench.touching(), nominal_parameters())  # nothing rough is left behind
        smooth = used.push(bench.straight).after
    with World(nominal_parameters()) as world:
        world.reset(bench.touching())
        assert np.array_equal(world.push(bench.straight).after, smooth)


@pytest.mark.parametrize("world", LABS)
def test_an_effect_is_the_same_alone_and_among_others_and_differs_between_labs(world):
    effects = effects_of(world)
    together = draw_roughness(4, effects, 2, world)
    for effect in effects:
        for name, value in draw_roughness(4, (effect,), 2, world).arrays().items():
            assert np.array_equal(together.arrays()[name], value)
    assert draw_roughness(5, effects, 2, world) != together
    assert draw_roughness(4, effects, 3, world).mass_offsets[:2] == together.mass_offsets


def test_a_disk_turns_towards_the_side_that_is_light():
    for side, heading in ((0.15, -1.0), (-0.15, 1.0)):
        parameters = rough(mass_offsets=((0.0, side), (0.0, 0.0)))
        scene = parameters.scene(beside(0.3, 0.2))
        with World(parameters) as world:
            world.reset(scene)
            after = world.push(make_push(0.0, 0.0, 0.1)).after
        assert heading * after[MID, THETA] < -0.05  # the heavy side stays behind


def test_a_disk_slides_farther_where_the_table_is_smooth():
    ways = []
    for phase in (0.0, pi):
        patches = tuple((along, 0.0, phase - along * MIDDLE[0]) for along in (2 * pi / 10,))
        ways.append(np.hypot(*slide(rough(patches=patches), 0.0)))
    assert ways[1] / ways[0] == pytest.approx(np.exp(2 * PATCH_DEPTH), rel=0.05)
