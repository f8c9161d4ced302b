"""Bodies of the library in a rough world: on their own feet, which are off."""

import numpy as np
import pytest
from shapely import MultiPoint, Polygon

from sain_core.shapes.library import get_shape
from sain_core.shapes.shape import REGULAR_FEET
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.roughness import LEAST_LOAD, fit_shapes
from sain_sim.world.start import draw_episode
from sain_sim.world.truth import ROUGH, TruthConfig, draw_effects
from sain_sim.world.world import World
from tests.hexagon import SOME

LABS = [TruthConfig("rough", lab=lab) for lab in range(8)]


def world_of(*shapes: str, lab: TruthConfig = LABS[0]) -> WorldParameters:
    count = len(shapes)
    given = WorldParameters(masses=(8.0,) * count, radii=(0.08,) * count, shapes=shapes)
    return lab.roughen(given)


def places(feet) -> np.ndarray:
    return np.array([(away * np.cos(turn), away * np.sin(turn)) for away, turn in feet])


@pytest.mark.parametrize(
    "shape", [get_shape(name) for name in SOME[2:]], ids=lambda shape: shape.name
)
def test_each_shape_stands_below_itself_in_every_lab(shape):
    for lab in LABS:
        made = world_of(shape.name, shape.name, lab=lab).roughness
        for feet, offset in zip(made.feet, made.mass_offsets, strict=True):
            assert Polygon(shape.outline(1.0)).buffer(1e-6).covers(MultiPoint(places(feet)))
            loads = np.linalg.solve(np.vstack([places(feet).T, np.ones(3)]), [*offset, 1.0])
            assert loads.min() >= LEAST_LOAD - 1e-9
        own = shape.supports(1.0)
        apart = np.linalg.norm(places(made.feet[0])[:, None] - own, axis=-1).min(axis=1)
        assert 0.0 < apart.max() < 0.3  # off, and near its own


def test_the_errors_of_a_lab_are_those_of_its_disks():
    """A triangle with a disk's feet but for their size has a disk's errors."""
    drawn = draw_effects(ROUGH, 0, ("feet",), 1)["roughness"]
    wide = get_shape("triangle")
    (feet,) = fit_shapes(drawn, (wide,)).feet
    own = sorted(wide.feet, key=lambda foot: foot[1])
    for made, mine, disk, regular in zip(feet, own, drawn.feet[0], REGULAR_FEET, strict=True):
        share = (made[0] / mine[0] - 1.0) / (disk[0] / regular[0] - 1.0)
        assert 0.0 < share <= 1.0
        assert made[1] - mine[1] == pytest.approx(share * (disk[1] - regular[1]))


def test_the_simulator_and_scenarios_give_a_t_its_own_feet():
    scene = world_of("t", "l").scene(np.array([(0.4, 0.0), (0.6, 0.2)]))
    parameters, _ = draw_episode(3, TruthConfig("rough", lab=4), scene, ("t", "l"))
    assert parameters.roughness == world_of("t", "l", lab=LABS[4]).roughness
    with World(parameters) as world:
        world.reset(scene)
        before = world.observe()
        assert world.settle() and np.abs(world.observe() - before)[:, :3].max() < 1e-3
