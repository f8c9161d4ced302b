"""Flat bottoms slide and turn as Coulomb friction under uniform pressure lets them."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import ConfigError
from sain_core.scene import DISK_HEIGHT
from sain_core.shapes.library import get_shape
from sain_core.shapes.shape import FLAT
from sain_core.shapes.solids import _within
from sain_sim.world.parameters import WorldParameters, nominal_parameters
from sain_sim.world.roughness import Roughness
from sain_sim.world.truth import TruthConfig
from sain_sim.world.workcell import GRAVITY, CellState
from sain_sim.world.world import World

FRICTION, RADIUS, HEADING = 0.2, 0.08, 0.3


def flat(name: str, mass: float = 8.0) -> WorldParameters:
    return WorldParameters((mass,), (RADIUS,), (name,), friction=FRICTION).on(FLAT)


def thrown(world: World, velocity: np.ndarray, spin: float) -> np.ndarray:
    """Where a body at rest ends that is given a velocity [m/s] and a spin [rad/s]."""
    parameters = world.parameters
    world.reset(parameters.scene(np.array([[0.48, 0.0]]), np.array([HEADING])))
    states, home = world._cell.origin
    if world.engine == "bullet":
        moving = [states[0]._replace(velocity=(*velocity, 0.0), spin=(0.0, 0.0, spin))]
    else:
        moving = states._replace(speeds=np.array([[*velocity, 0.0, 0.0, 0.0, spin]]))
    world._build(CellState(moving, home))
    assert world.settle()
    return world.observe()[0]


def coulomb(name: str, velocity: np.ndarray, spin: float) -> tuple[np.ndarray, float]:
    """The way [m] and the turn [rad] of a body under uniform pressure, integrated finely.

    Its weight presses on the front while it brakes: the pressure is linear, and balances it.
    """
    shape = get_shape(name)
    line = np.linspace(-1.0, 1.0, 40)
    grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    points = RADIUS * grid[_within(shape, grid)]
    points -= points.mean(axis=0)
    tilt = np.linalg.inv(points.T @ points)
    inertia, step = shape.inertia(1.0, RADIUS)[2], 1e-3
    way, turn, braking = np.zeros(2), HEADING, np.zeros(2)
    while np.hypot(*velocity) > 2e-3 or abs(spin) > 2e-2:
        arms = points @ _axes(turn)
        lean = _axes(turn) @ (-DISK_HEIGHT / 2 / GRAVITY * braking)
        load = 1.0 / len(points) + points @ tilt @ lean
        slip = velocity + spin * np.stack([-arms[:, 1], arms[:, 0]], axis=1)
        force = -FRICTION * GRAVITY * load[:, None] * slip / (np.hypot(*slip.T) + 1e-9)[:, None]
        braking = force.sum(axis=0)
        velocity = velocity + step * braking
        spin += step * (arms[:, 0] * force[:, 1] - arms[:, 1] * force[:, 0]).sum() / inertia
        way, turn = way + step * velocity, turn + step * spin
    return way, turn - HEADING


def _axes(angle: float) -> np.ndarray:
    """The axes (2, 2) of a body, a row each, in the world."""
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize("name", ["disk", "t", "box_2x1"])
def test_what_is_thrown_stops_and_turns_as_uniform_pressure_lets_it(name, engine):
    with World(flat(name), engine=engine) as world:
        for speed, spin in ((0.25, 0.0), (0.0, 6.0), (0.25, 3.0)):
            velocity = np.array([speed, 0.0])
            way, turn = coulomb(name, velocity, spin)
            end = thrown(world, velocity, spin)
            assert np.hypot(*(end[:2] - [0.48, 0.0] - way)) < 0.0012
            assert abs(end[2] - HEADING - turn) < np.radians(2.0)


def test_the_distance_does_not_depend_on_the_mass(engine):
    ends = []
    for mass in (0.5, 8.0, 60.0):
        with World(flat("t", mass), engine=engine) as world:
            ends.append(thrown(world, np.array([0.2, 0.0]), 2.0)[:3])
    assert np.ptp(ends, axis=0)[:2].max() < 0.001 and np.ptp(ends, axis=0)[2] < np.radians(2.0)


def test_flat_bodies_rest_where_they_are_and_repeat_to_the_bit(engine, bench):
    parameters = nominal_parameters(shapes=("disk", "t")).on(FLAT)
    ends = []
    for _ in range(2):
        with World(parameters, engine=engine) as world:
            start = bench.touching(parameters)
            world.reset(start)
            assert world.settle()
            np.testing.assert_allclose(world.observe()[:, :3], start[:, :3], atol=1e-5)
            outcome = world.push(bench.straight)
            assert outcome.settled
            ends.append(outcome.after)
    assert np.array_equal(*ends)


@pytest.mark.parametrize("bottom", ["feet", "flat"])
def test_a_body_turns_towards_where_its_mass_is(engine, bottom, bench):
    """A push through the middle turns the mass, which lags, to the other side."""
    turns = []
    for side in (-1.0, 1.0):
        roughness = Roughness(mass_offsets=((0.0, 0.15 * side),))
        parameters = replace(flat("disk").on(bottom), roughness=roughness)
        with World(parameters, engine=engine) as world:
            world.reset(parameters.scene(np.array([[0.48, 0.0]])))
            turns.append(world.push(bench.straight).after[0, 2])
    assert turns[0] == pytest.approx(-turns[1], abs=0.03) and turns[1] > 0.05


def test_a_rough_world_moves_no_feet_of_a_flat_bottom():
    with pytest.raises(ConfigError, match="no feet to be moved; use mass,patches,direction"):
        TruthConfig(world="rough", bottom=FLAT)
    truth = TruthConfig(world="rough", bottom=FLAT, effects="mass,tilt")
    drawn = truth.roughen(nominal_parameters(shapes=("disk", "t")))
    assert drawn.bottom == FLAT and any(any(offset) for offset in drawn.mass_offsets)
    assert truth.settings()["bottom"] == FLAT and "bottom" not in TruthConfig().settings()
