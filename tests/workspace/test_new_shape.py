"""A new shape is one file and its registration: no other file of the project names it.

The hexagon of `tests.hexagon` goes through a collection, a scenario, a world, pictures and markers.
"""

from math import degrees, radians, sqrt

import numpy as np
import pytest

from sain_core.push import make_push
from sain_core.scene import MID, POSITION, TARGET, THETA, X, Y, make_scene, unit
from sain_core.shapes.solids import DISK
from sain_sim.collecting.collect import CollectConfig, collect
from sain_sim.collecting.episode import EpisodeConfig
from sain_sim.collecting.shards import load_shards
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.start import draw_episode
from sain_sim.world.truth import TruthConfig
from sain_sim.world.world import World

RADIUS_M = 0.06
CORNER = 2 / sqrt(3) * RADIUS_M  # [m], from the centre to a corner
pytestmark = pytest.mark.usefixtures("hexagon")


def two_bodies(turn: float) -> tuple[np.ndarray, WorldParameters]:
    """A disk and a hexagon that is turned, well apart."""
    places, headings = np.array([[0.4, -0.2], [0.5, 0.1]]), np.array([0.0, turn])
    scene = make_scene(places, np.full(2, 8.0), np.full(2, RADIUS_M), headings)
    return scene, WorldParameters.of_scene(scene, shapes=(DISK, "six_sided"))


@pytest.mark.parametrize(
    ("bearing", "reach"), [(0, RADIUS_M), (60, RADIUS_M), (30, CORNER), (150, CORNER)]
)
def test_its_sides_and_corners_touch_where_they_are(bearing, reach):
    scene, parameters = two_bodies(turn=0.2)
    way = np.array([*unit(np.asarray(0.2 + radians(bearing))), 0.0])
    with World(parameters) as world:
        world.reset(scene)
        client, body = world._simulation.client, world._cell.bodies[TARGET].id
        ball = client.createCollisionShape(client.GEOM_SPHERE, radius=0.01)
        place = np.array([*scene[TARGET, POSITION], 0.02]) + (reach + 0.02) * way
        probe = client.createMultiBody(1.0, ball, -1, place.tolist())
        gap = min(contact[8] for contact in client.getClosestPoints(probe, body, 0.05))
    assert gap == pytest.approx(0.01, abs=2e-4)


def test_a_world_pushes_it_like_any_body():
    parameters, start = draw_episode(0, TruthConfig("nominal"), shapes=("disk", "six_sided"))
    assert parameters.shapes == (DISK, "six_sided")
    push = make_push(0.0, 0.0, 0.1)
    with World(parameters) as world:
        world.reset(start)
        outcome = world.push(push)
        world.reset(start)
        assert np.array_equal(world.push(push).after, outcome.after)
    moved = outcome.after[TARGET] - outcome.before[TARGET]
    assert outcome.settled and 0.08 < moved[X] < 0.11 and abs(moved[Y]) < 0.01
    gap = outcome.after[TARGET, X] - outcome.after[MID, X] - sum(parameters.radii)
    assert abs(gap) < 0.002  # the side that faced the mid disk still does
    assert abs(degrees(moved[THETA])) < 5.0


def test_a_collection_and_its_data_set_say_which_body_it_is(tmp_path):
    episode = EpisodeConfig(pushes=2, target="six_sided")
    done = collect(CollectConfig(tmp_path, episodes=2, seed=1, episode=episode))
    data = load_shards(tmp_path)
    assert done.transitions == len(data["shapes"]) > 0
    assert set(data["shapes"]) == {"disk,six_sided"}
