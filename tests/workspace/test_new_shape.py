"""A new shape is one file and its registration: no other file of the project names it.

The hexagon of `tests.hexagon` goes through a collection, a scenario, a world, pictures and markers.
"""

from math import atan2, degrees, hypot, pi, radians, sqrt

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Polygon as Patch

from sain_core.feasibility import Feasibility
from sain_core.goal import Goal
from sain_core.push import make_push
from sain_core.scene import MID, POSITION, RADIUS, TARGET, THETA, X, Y, make_scene, unit
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.solids import DISK
from sain_core.view.scenes import bodies_in
from sain_eval.episode import EpisodeRecord
from sain_eval.plots.pictures import draw_top_view
from sain_eval.scenes.families import AnywhereScenario, PaperScenario
from sain_sim.camera.render import CameraConfig, Renderer
from sain_sim.collecting.collect import CollectConfig, collect
from sain_sim.collecting.episode import EpisodeConfig
from sain_sim.collecting.shards import load_shards
from sain_sim.world.parameters import WorldParameters
from sain_sim.world.start import draw_episode
from sain_sim.world.truth import TruthConfig
from sain_sim.world.world import World

JOINTS = np.array([0.8, -1.0, 0.0, -2.6, 0.0, 1.6, 0.8])  # out of the picture
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


@pytest.mark.parametrize("family", [PaperScenario, AnywhereScenario])
def test_a_scenario_turns_one_of_its_sides_to_the_mid_disk(family):
    case = family("hexagons", target_shape="six_sided").scene(3)
    assert case.parameters().shapes == (DISK, "six_sided")
    x, y = case.disks[TARGET, POSITION] - case.disks[MID, POSITION]
    assert case.disks[TARGET, THETA] == pytest.approx(atan2(y, x), abs=1e-9)
    assert hypot(x, y) == pytest.approx(case.disks[:, RADIUS].sum() + 0.001)


def test_a_rendered_picture_shows_its_corners():
    """From above, the orange of the target is as wide as a hexagon in both directions."""
    above = CameraConfig(
        width=200, height=200, eye=(0.499, 0.1, 2.0), focus=(0.5, 0.1, 0.0), field_of_view=6.0
    )
    sizes = {}
    for turn in (0.0, pi / 2):
        scene, parameters = two_bodies(turn)
        with Renderer(scene, parameters.shapes, above) as renderer:
            picture = renderer.picture(JOINTS, scene).astype(int)
        orange = picture[..., 0] - picture[..., 2] > 60
        rows, columns = np.nonzero(orange)
        sizes[turn] = np.ptp(rows) + 1, np.ptp(columns) + 1
    (along, across), turned = sizes[0.0], sizes[pi / 2]
    assert across / along == pytest.approx(2 / sqrt(3), rel=0.03)
    assert turned[0] / turned[1] == pytest.approx(2 / sqrt(3), rel=0.03)


def test_the_top_view_draws_its_outline():
    scene, _ = two_bodies(turn=0.3)
    record = EpisodeRecord(
        Goal.place(0.7, 0.0, 0.05), (), scene, Bodies.named(("disk", "six_sided"))
    )
    axes = Figure((4, 4)).add_axes((0, 0, 1, 1))
    draw_top_view(axes, record, Feasibility())
    outlines = [patch.get_xy() for patch in axes.patches if type(patch) is Patch]
    outlines = [outline for outline in outlines if len(outline) == 7]  # not the reach
    assert len(outlines) == 2  # at the start and at the end
    for outline in outlines:
        offset = outline[:-1] - scene[TARGET, POSITION]
        bearings = np.degrees(np.arctan2(offset[:, 1], offset[:, 0]) - 0.3) % 60.0
        assert np.allclose(bearings, 30.0)
        assert np.allclose(np.hypot(*offset.T), CORNER)


def test_rviz_gets_its_faces():
    messages = pytest.importorskip("builtin_interfaces.msg")
    from visualization_msgs.msg import Marker

    from sain_core.ros.markers import markers_of

    scene, parameters = two_bodies(turn=0.3)
    markers = markers_of(bodies_in(scene, parameters.bodies), messages.Time())
    disk, marker = (marker for marker in markers if marker.ns == "bodies")
    assert (disk.type, marker.type) == (Marker.CYLINDER, Marker.TRIANGLE_LIST)
    corners = np.array([(point.x, point.y) for point in marker.points])
    assert len(corners) == 3 * 4 * 6
    assert np.hypot(*corners.T).max() == pytest.approx(CORNER)
    assert (marker.pose.position.x, marker.pose.position.y) == tuple(scene[TARGET, POSITION])
    assert 2 * np.arctan2(marker.pose.orientation.z, marker.pose.orientation.w) == pytest.approx(
        0.3
    )
