"""The bodies of the scene, the table, and how far the tool reaches."""

from typing import Any, Final

import numpy as np
import viser

from sain_core.drawing.palette import PALETTE
from sain_core.scene import DISK_HEIGHT, RADIUS, THETA, X, Y, unit
from sain_core.shapes.bodies import Bodies, Role
from sain_core.types import Scene
from sain_live.aims import FEASIBILITY
from sain_live.page.geometry import line, mesh, rgb, ring, upright
from sain_live.state import LiveState

THICKNESS: Final = 0.02  # [m], of the table
EDGE: Final = 0.0025  # [m], of lines
ABOVE: Final = 0.0006  # [m], of lines over what they lie on
LABEL_HEIGHT: Final = 0.03  # [m]
DARKER: Final = 0.62


class BodiesView:
    """Draws the bodies where they are."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Draw the table."""
        self._scene = server.scene
        self._frames: list[Any] = []
        self._made: tuple[Bodies, tuple[float, ...]] | None = None
        self._shown: Scene | None = None
        self._draw_table()

    def show(self, known: LiveState) -> None:
        """Draw what has changed."""
        seen, bodies = known.scene, known.bodies
        if seen is None or bodies is None or len(bodies) != len(seen.disks):
            return
        made = bodies, tuple(seen.disks[:, RADIUS].tolist())
        if self._made is None or self._made[0] is not bodies or self._made[1] != made[1]:
            self._make(seen.disks, bodies)
            self._made, self._shown = made, None
        if self._shown is seen.disks:
            return
        for body, (frame, row) in enumerate(zip(self._frames, seen.disks, strict=True)):
            if self._shown is not None and np.array_equal(row[:3], self._shown[body, :3]):
                continue
            frame.position = (row[X], row[Y], DISK_HEIGHT / 2)
            frame.wxyz = upright(float(row[THETA]))
        self._shown = seen.disks

    def _make(self, scene: Scene, bodies: Bodies) -> None:
        for frame in self._frames:
            frame.remove()
        self._frames = []
        for body, shape in enumerate(bodies.shapes):
            name, radius = f"/bodies/{body}", float(scene[body, RADIUS])
            colour = rgb(PALETTE.disk(body))
            red, green, blue = (round(DARKER * part) for part in colour)
            frame = self._scene.add_frame(name, show_axes=False)
            vertices, faces = mesh(shape, radius)
            self._scene.add_mesh_simple(
                f"{name}/solid", vertices, faces, color=colour, flat_shading=True
            )
            edges = ring(shape.outline(radius), DISK_HEIGHT / 2 + ABOVE)
            if not shape.is_round:
                tick = shape.circumradius * radius * np.array([[0.0, 0.0], [0.35, 0.0]])
                edges = np.concatenate([edges, line(tick, DISK_HEIGHT / 2 + ABOVE)])
            self._scene.add_line_segments(
                f"{name}/edges", edges, (red, green, blue), thickness=EDGE
            )
            self._scene.add_label(
                f"{name}/label",
                label(body, bodies),
                position=(0.0, 0.0, DISK_HEIGHT / 2 + LABEL_HEIGHT),
                font_screen_scale=0.8,
                anchor="bottom-center",
            )
            self._frames.append(frame)

    def _draw_table(self) -> None:
        table, reach = FEASIBILITY.table, FEASIBILITY.reach
        size = (table.x_max - table.x_min, table.y_max - table.y_min, THICKNESS)
        middle = ((table.x_min + table.x_max) / 2, (table.y_min + table.y_max) / 2, -THICKNESS / 2)
        self._scene.add_box(
            "/table", color=rgb(PALETTE.table_edge), dimensions=size, position=middle
        )
        bearings = np.linspace(-np.pi, np.pi, 721)
        for name, distance in (("inner", reach.inner), ("outer", reach.outer)):
            places = distance * unit(bearings)
            within = table.contains(places)
            arc = line(places, ABOVE)[within[:-1] & within[1:]]
            self._scene.add_line_segments(
                f"/reach/{name}", arc, rgb(PALETTE.reach_edge), thickness=EDGE
            )


def label(body: int, bodies: Bodies) -> str:
    """Return what is written over a body."""
    role = bodies.roles[body]
    if bodies.stand_in_for_disks:
        return {0: "pusher", 1: "target"}.get(body, f"{body}")
    more = "" if role is Role.PUSHABLE else f", {role}"
    return f"{body} {bodies.shapes[body].footprint}{more}"
