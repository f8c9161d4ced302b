"""What the planner expects, and after each push the prediction beside the result."""

from typing import Any, Final

import numpy as np
import viser

from sain_core.drawing.palette import PALETTE
from sain_core.push import LENGTH, PushLimits, pushed_bodies, strokes
from sain_core.scene import DISK_HEIGHT, POSITION, RADIUS, THETA, X, Y, unit
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene
from sain_live.page.geometry import (
    Rgb,
    Segments,
    blend,
    circle,
    lifted,
    line,
    mesh,
    outline,
    rgb,
    upright,
)
from sain_live.state import LivePlan, LiveResult, LiveState, largest_error

CHEAP: Final = (38, 140, 85)
DEAR: Final = (226, 176, 168)
CHOSEN: Final = rgb(PALETTE.ink)
PREDICTED: Final = rgb(PALETTE.predicted)
PHYSICS: Final = rgb(PALETTE.physics)
RESULT: Final = rgb(PALETTE.ink)
REGION: Final = (222, 168, 32)
GHOST: Final = 0.25  # opacity
THIN: Final = 0.0014  # [m]
THICK: Final = 0.005
LINE: Final = 0.003
TOP: Final = DISK_HEIGHT + 0.002  # [m]
LIFT: Final = 0.001  # [m], of lines over others
MOVED: Final = 0.001  # [m]
LIMITS: Final = PushLimits()


class PlanView:
    """Draws the plan, and the last push as it was predicted and as it went."""

    def __init__(self, server: viser.ViserServer) -> None:
        """Draw nothing yet."""
        self._scene = server.scene
        self._plan: LivePlan | None = None
        self._result: LiveResult | None = None
        self._nodes: dict[str, list[Any]] = {"plan": [], "result": []}

    def show(self, known: LiveState) -> None:
        """Draw what is new."""
        bodies = known.bodies
        if known.plan is not self._plan:
            self._plan = known.plan
            self._clear("plan")
            if known.plan is not None and bodies is not None:
                self._draw_plan(known.plan, bodies, _aimed(known, len(bodies)))
        if known.result is not self._result:
            self._result = known.result
            self._clear("result")
            if known.result is not None and bodies is not None:
                self._draw_result(known.result, bodies)

    def _clear(self, group: str) -> None:
        for node in self._nodes[group]:
            node.remove()
        self._nodes[group] = []

    def _lines(
        self,
        group: str,
        name: str,
        segments: Segments | list[Segments],
        colour: Rgb | np.ndarray,
        thickness: float = LINE,
    ) -> None:
        points = np.concatenate(segments) if isinstance(segments, list) else segments
        if len(points):
            node = self._scene.add_line_segments(
                f"/{group}/{name}", points, colour, thickness=thickness
            )
            self._nodes[group].append(node)

    def _draw_plan(self, plan: LivePlan, bodies: Bodies, aimed: list[int]) -> None:
        if len(plan.start) != len(bodies) or not len(plan.predicted):
            return
        shown = sorted({*aimed, *pushed_bodies(plan.pushes).tolist()})
        self._draw_others(plan, aimed)
        ways = np.concatenate([plan.start[None], plan.predicted])[:, :, POSITION]
        self._lines("plan", "chosen", line(ways[:, shown].swapaxes(0, 1), TOP), CHOSEN, THICK)
        later = [
            outline(bodies.shapes[b], after[b], TOP) for after in plan.predicted for b in shown
        ]
        self._lines("plan", "later", later, PREDICTED, THIN)
        for body in shown:
            state = plan.predicted[0, body]
            vertices, faces = mesh(bodies.shapes[body], float(state[RADIUS]))
            ghost = self._scene.add_mesh_simple(
                f"/plan/ghost{body}",
                vertices,
                faces,
                color=PREDICTED,
                opacity=GHOST,
                cast_shadow=False,
                position=(state[X], state[Y], DISK_HEIGHT / 2),
                wxyz=upright(float(state[THETA])),
            )
            self._nodes["plan"].append(ghost)
        if plan.regions is not None:
            radii = plan.regions[0]
            rings = [
                circle(plan.predicted[0, b, POSITION], float(radii[b]), TOP + LIFT)
                for b in shown
                if radii[b] > 0.0
            ]
            self._lines("plan", "regions", rings or [np.empty((0, 2, 3))], REGION)
        self._draw_push(plan, bodies)

    def _draw_others(self, plan: LivePlan, aimed: list[int]) -> None:
        """Draw where other sequences lead the bodies of the goal, from cheap to dear."""
        count, horizon = plan.places.shape[:2]
        if not count or not aimed:
            return
        start = np.broadcast_to(plan.start[:, POSITION], (count, 1, *plan.start[:, POSITION].shape))
        ways = np.concatenate([start, plan.places], axis=1)[:, :, aimed]
        segments = line(ways.swapaxes(1, 2), TOP - LIFT)
        share = np.linspace(0.0, 1.0, count) ** 0.5
        colours = np.repeat(blend(CHEAP, DEAR, share), len(aimed) * horizon, axis=0)
        both_ends = np.repeat(colours[:, None], 2, axis=1)
        self._lines("plan", "others", segments, both_ends, THIN)

    def _draw_push(self, plan: LivePlan, bodies: Bodies) -> None:
        push = plan.pushes[0]
        if push[LENGTH] <= 0.0:
            return
        start, heading = strokes(plan.start, push, LIMITS, bodies)
        ends = lifted(np.stack([start, start + push[LENGTH] * unit(heading)]), TOP)
        arrow = self._scene.add_arrows(
            "/plan/push",
            ends[None],
            CHOSEN,
            shaft_radius=0.003,
            head_radius=0.008,
            head_length=0.02,
        )
        self._nodes["plan"].append(arrow)

    def _draw_result(self, result: LiveResult, bodies: Bodies) -> None:
        after = result.after
        if len(after) != len(bodies):
            return
        shown = self._compared(result)
        for name, scene, colour in (
            ("physics", result.physics, PHYSICS),
            ("predicted", result.planned, PREDICTED),
            ("reality", after, RESULT),
        ):
            if scene is not None and len(scene) == len(after):
                rings = [outline(bodies.shapes[b], scene[b], TOP + LIFT) for b in shown]
                self._lines("result", name, rings or [np.empty((0, 2, 3))], colour)
        text = error_text(result)
        if text and shown:
            x, y = after[shown[0], POSITION].tolist()
            node = self._scene.add_label(
                "/result/label",
                text,
                position=(x, y, DISK_HEIGHT + 0.09),
                font_screen_scale=0.8,
                anchor="bottom-center",
            )
            self._nodes["result"].append(node)

    @staticmethod
    def _compared(result: LiveResult) -> list[int]:
        """Return the bodies that the push was to move, or that it moved otherwise."""
        expected = result.planned if result.planned is not None else result.physics
        if expected is None or expected.shape != result.after.shape:
            return []
        before = result.before if result.before is not None else expected
        moved = _way(result.after, before) > MOVED
        return np.flatnonzero(moved | (_way(expected, before) > MOVED)).tolist()


def error_text(result: LiveResult) -> str:
    """Return how far off the predictions of a push were, in words; "": nobody predicted."""
    parts = []
    for name, scene in (("prediction", result.planned), ("physics", result.physics)):
        error = largest_error(scene, result.after)
        if np.isfinite(error):
            parts.append(f"{name} {error:.1f} mm off")
    return ", ".join(parts)


def _way(scene: Scene, other: Scene) -> np.ndarray:
    return np.asarray(np.hypot(*(scene[:, POSITION] - other[:, POSITION]).T))


def _aimed(known: LiveState, count: int) -> list[int]:
    """Return the bodies of the goal."""
    poses = () if known.aim is None else known.aim.poses
    return [pose.body for pose in poses if pose.body < count]
