"""What is always there: background, table, and how far the tool reaches. Looks as in the films."""

from typing import Final

import numpy as np
import viser

from sain_core.drawing.palette import PALETTE
from sain_core.scene import unit
from sain_live.aims import FEASIBILITY
from sain_live.page.geometry import Rgb, line, rgb

SKY: Final = ((196, 212, 228), (244, 244, 241))  # upper and lower edge
TOP: Final = (243, 230, 207)
SIDES: Final = (196, 182, 162)
SEAM: Final = (214, 203, 184)
THICKNESS: Final = 0.02  # [m], of the table's top
HEIGHT: Final = 0.2  # [m], of what it stands on
INSET: Final = 0.97  # width of that, as a share of the top's
EDGE: Final = 1.5  # pixels, of lines
ABOVE: Final = 0.0006  # [m], of lines over the table


def draw_stage(server: viser.ViserServer) -> None:
    """Draw it all, once."""
    server.scene.set_background_image(sky(256), format="png")
    _draw_table(server.scene)
    _draw_reach(server.scene)


def sky(height: int) -> np.ndarray:
    """Return a soft background (height, height, 3)."""
    share = np.linspace(0.0, 1.0, height)[:, None]
    column = (1.0 - share) * np.array(SKY[0]) + share * np.array(SKY[1])
    return np.repeat(column[:, None], height, axis=1).round().astype(np.uint8)


def _draw_table(scene: viser.SceneApi) -> None:
    table = FEASIBILITY.table
    x, y = (table.x_min + table.x_max) / 2, (table.y_min + table.y_max) / 2
    wide, long = table.x_max - table.x_min, table.y_max - table.y_min

    def block(name: str, colour: Rgb, share: float, top: float, height: float) -> None:
        size, middle = (share * wide, share * long, height), (x, y, top - height / 2)
        scene.add_box(f"/table/{name}", color=colour, dimensions=size, position=middle)

    block("top", TOP, 1.0, 0.0, THICKNESS)
    block("under", SIDES, INSET, -THICKNESS, HEIGHT)
    corners = np.array(
        [
            (table.x_min, table.y_min),
            (table.x_max, table.y_min),
            (table.x_max, table.y_max),
            (table.x_min, table.y_max),
            (table.x_min, table.y_min),
        ]
    )
    edges = np.concatenate([line(corners, ABOVE), line(corners, -THICKNESS)])
    _draw_line(scene, "/table/edge", edges, SEAM)


def _draw_reach(scene: viser.SceneApi) -> None:
    bearings = np.linspace(-np.pi, np.pi, 361)
    for name in ("inner", "outer"):
        places = getattr(FEASIBILITY.reach, name) * unit(bearings)
        within = FEASIBILITY.table.contains(places)
        arc = line(places, ABOVE)[within[:-1] & within[1:]]
        _draw_line(scene, f"/reach/{name}", arc, rgb(PALETTE.reach_edge))


def _draw_line(scene: viser.SceneApi, name: str, segments: np.ndarray, colour: Rgb) -> None:
    scene.add_line_segments(name, segments, colour, thickness=EDGE, thickness_units="screen")
