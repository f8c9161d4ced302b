"""Whatever draws things draws all kinds of them, each where it is: read back from what is drawn."""

from collections.abc import Callable, Iterator
from contextlib import closing
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch

from sain_core.feasibility import Feasibility
from sain_core.goal import BodyPose, Goal
from sain_core.push import make_push
from sain_core.scene import POSITION, THETA, make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.view.palette import PALETTE
from sain_core.view.scenes import (
    bodies_in,
    episode_things,
    plan_things,
    predictions,
    push_arrow,
    stage,
)
from sain_core.view.things import (
    BodyPath,
    DrawnBody,
    GoalMark,
    Look,
    PushArrow,
    ReachArea,
    Region,
    Thing,
    hue,
)
from sain_core.world import PushRecord
from tests.strokes import tool_end, tool_start

BODIES = Bodies.named(("t", "disk", "star"), ("pushable", "movable", "fixed"))
GOAL = Goal((BodyPose(0, 0.60, 0.30, 0.8, 0.03), BodyPose(1, 0.80, -0.30, None, 0.03)))
START = make_scene(
    np.array([(0.45, 0.1), (0.65, -0.1), (0.95, 0.4)]),
    np.full(3, 4.0),
    np.array([0.09, 0.06, 0.05]),
)
PUSH = make_push(0.5, 0.1, 0.12)
LIMITS = Feasibility().limits
NEAR = 0.012  # [m]


def moved(scene: np.ndarray, body: int, way: tuple[float, float], turn: float = 0.0) -> np.ndarray:
    after = scene.copy()
    after[body, POSITION] += way
    after[body, THETA] += turn
    return after


AFTER = moved(START, 0, (0.10, 0.06), 0.4)
EXPECTED = moved(AFTER, 0, (0.03, -0.02), 0.3)
PHYSICS = moved(AFTER, 0, (-0.03, 0.04))
ROW = PushRecord(PUSH, START, AFTER, EXPECTED, PHYSICS)
REGIONS = np.full((2, 3), 0.05)
LATER = np.stack([AFTER, moved(AFTER, 1, (0.08, -0.1))])
OTHERS = np.stack([LATER, LATER])[..., POSITION] + np.array([0.04, 0.1])[:, None, None, None]


def row_things(row: PushRecord, bodies: Bodies, number: int = 0) -> list[Thing]:
    """Return a push and what was predicted of it."""
    return [
        *predictions(row.before, row.after, row.physics, bodies, Look.PHYSICS),
        *predictions(row.before, row.after, row.predicted, bodies, Look.EXPECTED),
        *push_arrow(row.before, row.push, bodies, number),
    ]


def plan() -> list[Thing]:
    pushes = np.stack([PUSH, PUSH])
    return plan_things(START, BODIES, GOAL, pushes, LATER, REGIONS, OTHERS)


EVERYTHING = [
    *stage(),
    *bodies_in(START, BODIES, GOAL),
    *plan(),
    *row_things(ROW, BODIES, 1),
    *(BodyPath(1, np.array([(0.3, -0.4), (0.5, -0.4), (0.5, -0.5)]), "target"),),
]


class TestTheList:
    def test_a_row_is_its_push_and_both_predictions_of_what_moved(self):
        things = row_things(ROW, BODIES, 4)
        physics, expected, arrow = things
        assert (physics.look, expected.look) == (Look.PHYSICS, Look.EXPECTED)
        np.testing.assert_array_equal(expected.state, EXPECTED[0])
        np.testing.assert_array_equal(physics.state, PHYSICS[0])
        assert hue(expected) == PALETTE.predicted and hue(physics) == PALETTE.physics
        np.testing.assert_allclose(arrow.start, tool_start(START, PUSH, LIMITS, BODIES))
        np.testing.assert_allclose(arrow.end, tool_end(START, PUSH, LIMITS, BODIES))
        assert arrow.number == 4

    def test_a_plan_has_the_bodies_that_are_wanted_pushed_or_moved(self):
        shown = plan()
        paths = [one for one in shown if isinstance(one, BodyPath) and one.look is Look.PLANNED]
        assert [one.number for one in paths] == [0, 1]
        scenes = np.stack([START, *LATER])
        for path in paths:
            np.testing.assert_array_equal(path.points, scenes[:, path.number, POSITION])
        regions = [one for one in shown if isinstance(one, Region)]
        assert [(one.number, one.radius) for one in regions] == [(0, 0.05), (1, 0.05)]
        np.testing.assert_array_equal(regions[0].place, AFTER[0, POSITION])
        others = [one for one in shown if isinstance(one, BodyPath) and one.look is Look.OTHER]
        assert [(one.number, one.share) for one in others] == [(0, 1), (0, 0), (1, 1), (1, 0)]
        assert [hue(one) for one in others[:2]] == [PALETTE.alarm, PALETTE.goal]

    def test_goals_are_placed_and_headings_count_only_where_asked_for(self):
        tee, disk = (one for one in plan() if isinstance(one, GoalMark))
        assert tee.body.state[:3].tolist() == [0.60, 0.30, 0.8] and tee.body.marked
        assert disk.body.place.tolist() == [0.80, -0.30] and not disk.body.marked

    def test_bodies_have_their_own_colour_if_they_may_be_pushed_or_have_a_pose(self):
        assert [one.colour for one in bodies_in(START, BODIES, GOAL)] == ["mid", "target", "other"]
        paper = bodies_in(START, Bodies.disks(3))
        assert [one.colour for one in paper] == ["mid", "target", "other"]
        assert [one.name for one in paper] == ["mid", "target", "disk 2"]

    def test_an_episode_has_its_pushes_numbered_and_its_misses(self):
        things = episode_things(START, [ROW, PushRecord(PUSH, AFTER, AFTER)], GOAL, BODIES)
        assert [one.number for one in things if isinstance(one, PushArrow)] == [1, 2]
        (miss,) = [t for t in things if isinstance(t, BodyPath) and t.look is Look.ERROR]
        np.testing.assert_array_equal(miss.points, [EXPECTED[0, POSITION], AFTER[0, POSITION]])

    @pytest.mark.parametrize("push", [make_push(0.0, 0.0, 0.1, body=7), np.full(5, np.nan)])
    def test_a_push_that_cannot_be_has_no_arrow(self, push):
        row = PushRecord(push, START, START)
        assert row_things(row, BODIES) == []


class Drawn:
    """Something that was drawn of things: whether there is something of a thing, and where."""

    def has(self, thing: Thing, places: np.ndarray) -> bool:
        """Whether all of these places (M, 2) [m] are drawn for a thing."""
        raise NotImplementedError


class OnAxes(Drawn):
    def __init__(self, things: list[Thing]) -> None:
        from sain_eval.plots.axes import draw_things

        self.axes = Figure((5, 5)).add_subplot()
        draw_things(self.axes, things)

    def has(self, thing: Thing, places: np.ndarray) -> bool:
        lines = [line.get_xydata() for line in self.axes.lines]
        lines += [path.vertices for one in self.axes.collections for path in one.get_paths()]
        for patch in self.axes.patches:
            if isinstance(patch, FancyArrowPatch):
                lines.append(np.array(patch._posA_posB))
            else:
                lines.append(patch.get_patch_transform().transform(patch.get_path().vertices))
        return any(_holds(line, places) for line in lines)


class AsMarkers(Drawn):
    def __init__(self, things: list[Thing]) -> None:
        pytest.importorskip("visualization_msgs.msg")
        from builtin_interfaces.msg import Time

        from sain_core.ros.markers import markers_of

        self.markers = markers_of(things, Time())
        keys = [(marker.ns, marker.id) for marker in self.markers]
        assert len(set(keys)) == len(keys)

    def has(self, thing: Thing, places: np.ndarray) -> bool:
        return any(_holds(self._outline(marker), places) for marker in self.markers)

    @staticmethod
    def _outline(marker: Any) -> np.ndarray:
        points = np.array([(one.x, one.y) for one in marker.points]).reshape(-1, 2)
        pose, size = marker.pose, marker.scale
        if not len(points) and marker.type == marker.CUBE:
            points = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (size.x / 2, size.y / 2)
        elif not len(points):
            bearings = np.linspace(0, 2 * np.pi, 720)
            points = size.x / 2 * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
        turn = 2 * np.arctan2(pose.orientation.z, pose.orientation.w)
        return _placed(points, (pose.position.x, pose.position.y), turn)


class OnPage(Drawn):
    """viser's nodes; a server that nobody watches."""

    def __init__(self, things: list[Thing]) -> None:
        viser = pytest.importorskip("viser")
        from sain_live.page.drawing import ThingsView

        with closing(_Server(viser)) as opened:
            view = ThingsView(opened.server.scene)
            view.show_bodies([t for t in things if isinstance(t, DrawnBody) and t.look is Look.NOW])
            view.show(
                "all", [t for t in things if not isinstance(t, DrawnBody) or t.look is not Look.NOW]
            )
            handles = dict(opened.server.scene._handle_from_node_name)
            self.lines = list(self._read(handles))

    @staticmethod
    def _read(handles: dict[str, Any]) -> Iterator[np.ndarray]:
        for name, handle in handles.items():
            points = getattr(handle, "points", getattr(handle, "vertices", None))
            if points is None:
                continue
            above = handles.get(name.rpartition("/")[0])
            at = (0.0, 0.0, 0.0) if above is None else above.position
            turn = 0.0 if above is None else 2 * np.arctan2(above.wxyz[3], above.wxyz[0])
            flat = np.asarray(points, dtype=float).reshape(-1, 3)[:, :2]
            yield _placed(flat, at[:2], turn)

    def has(self, thing: Thing, places: np.ndarray) -> bool:
        return any(_holds(line, places) for line in self.lines)


class _Server:
    def __init__(self, viser: Any) -> None:
        from tests.sain_live.straw import free_port

        self.server = viser.ViserServer("127.0.0.1", free_port(), verbose=False)

    def close(self) -> None:
        self.server.stop()


class AsJson(Drawn):
    """What the script of the report page draws; its own test looks at the page in a browser."""

    def __init__(self, things: list[Thing]) -> None:
        import json

        from sain_bags.report.drawn import as_json

        self.parts = json.loads(json.dumps([as_json(thing) for thing in things]))

    def has(self, thing: Thing, places: np.ndarray) -> bool:
        return any(_holds(self._outline(part), places) for part in self.parts)

    def _outline(self, part: dict[str, Any]) -> np.ndarray:
        if "body" in part:
            return self._outline(part["body"])
        if "pieces" in part:
            return np.concatenate(part["pieces"])
        if "points" in part:
            return np.array(part["points"])
        corners, pose = part.get("outline"), part["pose"]
        if corners is None:
            bearings = np.linspace(0, 2 * np.pi, 720)
            corners = part["radius"] * np.stack([np.cos(bearings), np.sin(bearings)], axis=1)
        return _placed(np.array(corners), pose[:2], pose[2])


def _placed(points: np.ndarray, place: Any, turn: float) -> np.ndarray:
    cos, sin = np.cos(turn), np.sin(turn)
    return points @ np.array([[cos, sin], [-sin, cos]]) + np.asarray(place)


def _holds(line: np.ndarray, places: np.ndarray) -> bool:
    if not len(line):
        return False
    apart = np.linalg.norm(line[None] - places[:, None], axis=-1)
    return bool((apart.min(axis=1) < NEAR).all())


def places_of(thing: Thing) -> list[np.ndarray]:
    """Places (M, 2) [m] that must be drawn of a thing: one of these sets."""
    if isinstance(thing, ReachArea):
        return [np.concatenate(thing.outlines)]
    if isinstance(thing, GoalMark):
        ring = thing.body.place + thing.tolerance * ROUND
        return [thing.body.outline, *([] if thing.body.marked else [ring])]
    if isinstance(thing, Region):
        return [thing.place + thing.radius * ROUND]
    if isinstance(thing, BodyPath):
        return [thing.points]
    if isinstance(thing, PushArrow):
        return [np.stack([thing.start, thing.end])]
    return [thing.outline]


ROUND = np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])
BACK_ENDS: list[Callable[[list[Thing]], Drawn]] = [OnAxes, AsMarkers, OnPage, AsJson]


@pytest.mark.parametrize("draw", BACK_ENDS)
def test_every_kind_of_thing_is_drawn_where_it_is(draw):
    drawn = draw(EVERYTHING)
    kinds = {type(thing) for thing in EVERYTHING}
    assert len(kinds) == 7
    for thing in EVERYTHING:
        assert any(drawn.has(thing, places) for places in places_of(thing)), thing
