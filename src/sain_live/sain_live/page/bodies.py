"""The bodies of the scene, each with a soft shadow and a name beside it."""

from typing import Any, Final

import numpy as np
import viser

from sain_core.drawing.palette import PALETTE
from sain_core.scene import DISK_HEIGHT, RADIUS, THETA, X, Y
from sain_core.shapes.bodies import Bodies, Role
from sain_core.shapes.shape import Shape
from sain_core.types import Scene
from sain_live.page.geometry import line, mesh, rgb, ring, upright
from sain_live.state import LiveState

EDGE: Final = 1.5  # pixels, of outlines
MARK: Final = 0.007  # [m], of the line that shows how a body is turned
ABOVE: Final = 0.0008  # [m], of lines over what they lie on
DARKER: Final = 0.72
LIGHTER: Final = (255, 255, 255)
BESIDE: Final = (0.82, -0.57)  # where names are of their bodies: nearer to the camera
GAP: Final = 0.012  # [m], from a body to its name
SHADOWS: Final = ((1.18, 0.05), (1.10, 0.09), (1.03, 0.14))  # size and opacity: soft at the edge
SHIFT: Final = (-0.006, 0.014)  # [m], of shadows: the light comes from the right
FLAT: Final = 0.0004  # [m], height of a shadow


class BodiesView:
    """Draws the bodies where they are."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Draw nothing yet."""
        self._scene = server.scene
        self._frames: list[tuple[Any, Any, Any]] = []  # of body, shadow and name
        self._made: tuple[Bodies, tuple[float, ...]] | None = None
        self._shown: Scene | None = None

    def show(self, known: LiveState) -> None:
        """Draw what has changed."""
        seen, bodies = known.scene, known.bodies
        if seen is None or len(bodies) != len(seen.disks):
            return
        made = bodies, tuple(seen.disks[:, RADIUS].tolist())
        if self._made is None or self._made[0] is not bodies or self._made[1] != made[1]:
            self._make(seen.disks, bodies)
            self._made, self._shown = made, None
        if self._shown is seen.disks:
            return
        for body, (frames, row) in enumerate(zip(self._frames, seen.disks, strict=True)):
            if self._shown is not None and np.array_equal(row[:3], self._shown[body, :3]):
                continue
            solid, shadow, name = frames
            x, y, turn = float(row[X]), float(row[Y]), upright(float(row[THETA]))
            away = bodies.shapes[body].circumradius * float(row[RADIUS]) + GAP
            solid.position, solid.wxyz = (x, y, DISK_HEIGHT / 2), turn
            shadow.position, shadow.wxyz = (x + SHIFT[0], y + SHIFT[1], 0.0), turn
            name.position = (x + away * BESIDE[0], y + away * BESIDE[1], 0.0)
        self._shown = seen.disks

    def _make(self, scene: Scene, bodies: Bodies) -> None:
        for frame in (frame for frames in self._frames for frame in frames):
            frame.remove()
        self._frames = []
        for body, shape in enumerate(bodies.shapes):
            radius = float(scene[body, RADIUS])
            frames = (
                self._add_solid(body, shape, radius),
                self._add_shadow(body, shape, radius),
                self._scene.add_label(
                    f"/names/{body}",
                    label(body, bodies),
                    font_screen_scale=0.75,
                    anchor="top-center",
                ),
            )
            self._frames.append(frames)

    def _add_solid(self, body: int, shape: Shape, radius: float) -> Any:
        name, colour = f"/bodies/{body}", rgb(PALETTE.disk(body))
        frame = self._scene.add_frame(name, show_axes=False)
        vertices, faces = mesh(shape, radius)
        self._scene.add_mesh_simple(
            f"{name}/solid", vertices, faces, color=colour, flat_shading=True
        )
        red, green, blue = (round(DARKER * part) for part in colour)
        top, reach = DISK_HEIGHT / 2 + ABOVE, shape.circumradius * radius
        self._scene.add_line_segments(
            f"{name}/edges",
            ring(shape.outline(radius), top),
            (red, green, blue),
            thickness=EDGE,
            thickness_units="screen",
        )
        ends = np.array([[0.35, 0.0], [0.85, 0.0]] if shape.is_round else [[0.0, 0.0], [0.3, 0.0]])
        mark = line(reach * ends, top + ABOVE)
        self._scene.add_line_segments(f"{name}/mark", mark, LIGHTER, thickness=MARK)
        return frame

    def _add_shadow(self, body: int, shape: Shape, radius: float) -> Any:
        """Add darker and darker parts of the table: real shadows take too long to draw."""
        frame = self._scene.add_frame(f"/shadows/{body}", show_axes=False)
        vertices, faces = mesh(shape, radius)
        for number, (size, opacity) in enumerate(SHADOWS):
            flat = vertices * (size, size, 0.0) + (0.0, 0.0, FLAT * (number + 1))
            self._scene.add_mesh_simple(
                f"/shadows/{body}/{number}",
                flat,
                faces,
                color=rgb(PALETTE.ink),
                opacity=opacity,
                cast_shadow=False,
            )
        return frame


def label(body: int, bodies: Bodies) -> str:
    """Return the name of a body."""
    role = bodies.roles[body]
    if bodies.stand_in_for_disks:
        return {0: "pusher", 1: "target"}.get(body, f"{body}")
    more = "" if role is Role.PUSHABLE else f", {role}"
    return f"{body} {bodies.shapes[body].name}{more}"
