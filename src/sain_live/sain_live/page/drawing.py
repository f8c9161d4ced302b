"""Things to draw on viser: solid bodies with soft shadows and names, lines on the table over them.

Bodies as they are move with their nodes, so a scene in motion sends poses only.
"""

from collections.abc import Iterable, Sequence
from math import cos, sin
from typing import Any, Final

import numpy as np
import viser
from jaxtyping import Float
from numpy import ndarray

from sain_core.scene import DISK_HEIGHT, unit
from sain_core.types import Points
from sain_core.view import things as seen
from sain_core.view.palette import PALETTE, rgba
from sain_core.view.things import BodyPath, DrawnBody, GoalMark, Look, PushArrow, Thing, hue

Quaternion = tuple[float, float, float, float]  # w, x, y, z
Vector = tuple[float, float, float]
Rgb = tuple[int, int, int]
Segments = Float[ndarray, "S 2 3"]


def rgb(colour: str) -> Rgb:
    """Return a colour ``#rrggbb`` as whole numbers from 0 to 255."""
    red, green, blue, _ = rgba(colour)
    return round(255 * red), round(255 * green), round(255 * blue)


def upright(heading: float) -> Quaternion:
    """Return the turn about z by a heading [rad]."""
    return cos(heading / 2), 0.0, 0.0, sin(heading / 2)


def heading_of(turn: Sequence[float]) -> float:
    """Return the heading [rad] of a turn about z."""
    return float(2.0 * np.arctan2(turn[3], turn[0]))


def lifted(points: Points, height: float) -> ndarray:
    """Return points (..., 2) at a height [m], (..., 3)."""
    return np.concatenate([points, np.full((*points.shape[:-1], 1), height)], axis=-1)


def ring(points: Points, height: float) -> Segments:
    """Return the closed line through points (M, 2) at a height [m]."""
    corners = lifted(points, height)
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def line(points: Points, height: float) -> Segments:
    """Return the line through points (..., M, 2) at a height [m], as segments (S, 2, 3)."""
    corners = lifted(points, height)
    return np.stack([corners[..., :-1, :], corners[..., 1:, :]], axis=-2).reshape(-1, 2, 3)


def mesh(body: DrawnBody) -> tuple[ndarray, ndarray]:
    """Return vertices (V, 3) [m] and faces (T, 3) of a body about its centre."""
    corners = body.shape.triangles(body.radius).reshape(-1, 3)
    return corners, np.arange(len(corners)).reshape(-1, 3)


SKY: Final = ((196, 212, 228), (244, 244, 241))  # upper and lower edge
TOP: Final = (243, 230, 207)  # of the table, as in the films
SIDES: Final = (196, 182, 162)
SEAM: Final = (214, 203, 184)
THICKNESS: Final = 0.02  # [m], of the table's top
HEIGHT: Final = 0.2  # [m], of what it stands on
INSET: Final = 0.97  # width of that, as a share of the top's
EDGE: Final = 1.5  # pixels, of lines
THIN: Final = 1.0
PATH: Final = 2.0
GOAL_EDGE: Final = 3.0
ABOVE: Final = 0.0008  # [m], of lines over what they lie on
FLOOR: Final = 0.0016  # [m], of lines on the table: over the shadows
LIFT: Final = 0.0003  # [m], of lines over others
LOW: Final = 0.0025  # [m], of goals over the table
TOOL: Final = DISK_HEIGHT + 0.012  # [m], of the arrow of a push
MARK: Final = 0.007  # [m], width of the line that shows how a body is turned
DARKER: Final = 0.72
WHITE: Final = (255, 255, 255)
BESIDE: Final = np.array([0.82, -0.57])  # where names are of their bodies: nearer to the camera
GAP: Final = 0.012  # [m], from a body to its name
SHADOWS: Final = ((1.18, 0.05), (1.10, 0.09), (1.03, 0.14))  # size and opacity: soft at the edge
SHIFT: Final = np.array([-0.006, 0.014])  # [m], of shadows: the light comes from the right
FLAT: Final = 0.0004  # [m], height of a shadow
ALPHA: Final = 0.28  # of the area of a goal
CORNERS: Final = 48  # of a circle
ON_TOP: Final = (Look.EXPECTED, Look.PHYSICS)  # drawn over the bodies, the others on the table


class ThingsView:
    """Draws lists of things, each in a group of nodes; a new list replaces that of its group."""

    def __init__(self, scene: viser.SceneApi) -> None:
        self._scene = scene
        self._nodes: dict[str, list[Any]] = {}
        self._bodies: dict[int, tuple[DrawnBody, tuple[Any, Any, Any]]] = {}

    def show_bodies(self, bodies: Sequence[DrawnBody]) -> None:
        """Draw bodies as they are: moved where only that has changed."""
        for number in [one for one in self._bodies if one >= len(bodies)]:
            self._remove_body(number)
        for body in bodies:
            drawn = self._bodies.get(body.number)
            if drawn is not None and _look(drawn[0]) != _look(body):
                self._remove_body(body.number)
                drawn = None
            if drawn is None or not np.array_equal(drawn[0].state[:3], body.state[:3]):
                nodes = self._add_body(body) if drawn is None else drawn[1]
                _place(body, nodes)
                self._bodies[body.number] = body, nodes

    def show(self, group: str, things: Iterable[Thing]) -> None:
        """Draw things in place of the earlier ones of a group."""
        for node in self._nodes.pop(group, ()):
            node.remove()
        lines: dict[tuple[str, str, float], list[Segments]] = {}
        nodes = self._nodes[group] = []
        for thing in things:
            match thing:
                case seen.TableTop():
                    nodes += add_table(self._scene, f"/{group}/table", thing)
                case PushArrow():
                    nodes.append(self._add_arrow(f"/{group}/push", thing))
                case GoalMark():
                    nodes.append(add_goal(self._scene, f"/{group}/goal{thing.number}", thing))
                case _:
                    name, line_of, pixels = _as_lines(thing)
                    colour = PALETTE.reach_edge if isinstance(thing, seen.ReachArea) else hue(thing)
                    lines.setdefault((name, colour, pixels), []).append(line_of)
        for (name, colour, pixels), segments in lines.items():  # one node for those of a colour
            path = f"/{group}/{name}_{colour[1:]}"
            points = np.concatenate(segments)
            nodes.append(screen_lines(self._scene, path, points, rgb(colour), pixels))

    def _add_arrow(self, name: str, push: PushArrow) -> Any:
        ends = lifted(np.stack([push.start, push.end]), TOOL)
        return self._scene.add_arrows(
            name,
            ends[None],
            rgb(hue(push)),
            shaft_radius=0.0035,
            head_radius=0.010,
            head_length=0.024,
        )

    def _remove_body(self, number: int) -> None:
        for node in self._bodies.pop(number)[1]:
            node.remove()

    def _add_body(self, body: DrawnBody) -> tuple[Any, Any, Any]:
        """Add a body, its shadow and its name."""
        name, colour, scene = f"/bodies/{body.number}", rgb(hue(body)), self._scene
        solid = scene.add_frame(name, show_axes=False)
        vertices, faces = mesh(body)
        scene.add_mesh_simple(f"{name}/solid", vertices, faces, color=colour, flat_shading=True)
        red, green, blue = (round(DARKER * part) for part in colour)
        top = DISK_HEIGHT / 2 + ABOVE
        edges = ring(body.shape.outline(body.radius), top)
        screen_lines(scene, f"{name}/edges", edges, (red, green, blue), EDGE)
        ends = [[0.35, 0.0], [0.85, 0.0]] if body.shape.is_round else [[0.0, 0.0], [0.3, 0.0]]
        mark = line(body.size * np.array(ends), top + ABOVE)
        scene.add_line_segments(f"{name}/mark", mark, WHITE, thickness=MARK)
        text = scene.add_label(
            f"/names/{body.number}", body.name, font_screen_scale=0.75, anchor="top-center"
        )
        return solid, self._add_shadow(body), text

    def _add_shadow(self, body: DrawnBody) -> Any:
        """Add darker and darker parts of the table: real shadows take too long to draw."""
        frame = self._scene.add_frame(f"/shadows/{body.number}", show_axes=False)
        vertices, faces = mesh(body)
        for number, (size, opacity) in enumerate(SHADOWS):
            self._scene.add_mesh_simple(
                f"/shadows/{body.number}/{number}",
                vertices * (size, size, 0.0) + (0.0, 0.0, FLAT * (number + 1)),
                faces,
                color=rgb(PALETTE.ink),
                opacity=opacity,
                cast_shadow=False,
            )
        return frame


def _look(body: DrawnBody) -> tuple[Any, ...]:
    """Return what a body looks like, wherever it is."""
    return id(body.shape), body.radius, body.colour, body.name


def _place(body: DrawnBody, nodes: tuple[Any, Any, Any]) -> None:
    solid, shadow, name = nodes
    (x, y), turn = body.place.tolist(), upright(body.heading)
    solid.position, solid.wxyz = (x, y, DISK_HEIGHT / 2), turn
    shadow.position, shadow.wxyz = (*(body.place + SHIFT).tolist(), 0.0), turn
    name.position = (*(body.place + (body.size + GAP) * BESIDE).tolist(), 0.0)


def _as_lines(
    thing: DrawnBody | BodyPath | seen.ReachArea | seen.Region,
) -> tuple[str, Segments, float]:
    """Return the name of a node, the lines (S, 2, 3) [m] in it, and how thick they are."""
    if isinstance(thing, seen.ReachArea):
        rings = [ring(outline, ABOVE) for outline in thing.outlines]
        return "reach", np.concatenate(rings), EDGE
    if isinstance(thing, seen.Region):
        return "regions", circle(thing.place, thing.radius, FLOOR + 2 * LIFT), THIN
    if isinstance(thing, BodyPath):
        height = FLOOR + (0.0 if thing.look is Look.OTHER else LIFT)
        thickness = THIN if thing.look is Look.OTHER else PATH
        return f"{thing.look}_paths", line(thing.points, height), thickness
    height = DISK_HEIGHT + FLOOR if thing.look in ON_TOP else FLOOR + 2 * LIFT
    return f"{thing.look}_bodies", ring(thing.outline, height), THIN


def circle(centre: np.ndarray, radius: float, height: float) -> Segments:
    """Return a circle about a centre (2,) at a height [m]."""
    bearings = np.linspace(0.0, 2 * np.pi, CORNERS, endpoint=False)
    return ring(centre + radius * unit(bearings), height)


def screen_lines(
    scene: viser.SceneApi, name: str, segments: Segments, colour: Rgb, pixels: float
) -> Any:
    """Add lines (S, 2, 3) that are always so many pixels wide."""
    return scene.add_line_segments(
        name, segments, colour, thickness=pixels, thickness_units="screen"
    )


def add_goal(scene: viser.SceneApi, name: str, goal: GoalMark) -> Any:
    """Add a goal and return its node."""
    frame = scene.add_frame(name, show_axes=False)
    draw_goal(scene, name, goal)
    frame.position, frame.wxyz = (*goal.body.place.tolist(), LOW), upright(goal.body.heading)
    return frame


def draw_goal(scene: viser.SceneApi, name: str, goal: GoalMark) -> None:
    """Draw a goal about the origin of a node."""
    body, colour = goal.body, rgb(hue(goal))
    vertices, faces = mesh(body)
    flat = vertices * np.array([1.0, 1.0, 2 * LOW / DISK_HEIGHT])
    look: dict[str, Any] = {"color": colour, "opacity": ALPHA, "cast_shadow": False}
    scene.add_mesh_simple(f"{name}/area", flat, faces, **look)
    edges = [ring(body.shape.outline(body.radius), LOW), circle(np.zeros(2), goal.tolerance, LOW)]
    if body.marked:
        edges.append(line(np.array([[0.0, 0.0], [0.3 * body.size, 0.0]]), LOW))
    screen_lines(scene, f"{name}/edges", np.concatenate(edges), colour, GOAL_EDGE)


def add_table(scene: viser.SceneApi, name: str, table: seen.TableTop) -> list[Any]:
    """Add the top of a table, what it stands on, and its edges."""
    (x, y), (wide, long) = (table.low + table.high) / 2, table.high - table.low

    def block(part: str, colour: Rgb, share: float, top: float, height: float) -> Any:
        size, middle = (share * wide, share * long, height), (x, y, top - height / 2)
        return scene.add_box(f"{name}/{part}", color=colour, dimensions=size, position=middle)

    edges = np.concatenate([ring(table.outline, height) for height in (ABOVE, -THICKNESS)])
    return [
        block("top", TOP, 1.0, 0.0, THICKNESS),
        block("under", SIDES, INSET, -THICKNESS, HEIGHT),
        screen_lines(scene, f"{name}/edge", edges, SEAM, EDGE),
    ]


def sky(height: int) -> np.ndarray:
    """Return a soft background (height, height, 3)."""
    share = np.linspace(0.0, 1.0, height)[:, None]
    column = (1.0 - share) * np.array(SKY[0]) + share * np.array(SKY[1])
    return np.repeat(column[:, None], height, axis=1).round().astype(np.uint8)
