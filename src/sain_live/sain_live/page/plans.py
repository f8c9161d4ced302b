"""What the planner expects, and after each push the prediction beside the result."""

from typing import Any, Final

import numpy as np
import viser

from sain_core.drawing.palette import PALETTE
from sain_core.push import LENGTH, PushLimits, pushed_bodies, strokes
from sain_core.scene import DISK_HEIGHT, POSITION, unit
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene
from sain_live.page.geometry import (
    Rgb,
    Segments,
    circle,
    lifted,
    line,
    rgb,
    ring,
)
from sain_live.state import LivePlan, LiveResult, LiveState

OTHERS: Final = (184, 178, 166)
FEW: Final = 6  # other sequences that are shown, the cheapest
CHOSEN: Final = rgb(PALETTE.ink)
PREDICTED: Final = rgb(PALETTE.predicted)
LATER: Final = (184, 152, 211)  # the same, of pushes after the next one
PHYSICS: Final = rgb(PALETTE.physics)
REGION: Final = (222, 168, 32)
THIN: Final = 1.0  # pixels
LINE: Final = 2.0
FLOOR: Final = 0.0016  # [m], of lines on the table: over the shadows
LIFT: Final = 0.0003  # [m], of lines over others
TOOL: Final = DISK_HEIGHT + 0.012  # [m], of the arrow of a push
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
            if known.plan is not None:
                self._draw_plan(known.plan, bodies, _aimed(known, len(bodies)))
        if known.result is not self._result:
            self._result = known.result
            self._clear("result")
            if known.result is not None:
                self._draw_result(known.result, bodies)

    def _clear(self, group: str) -> None:
        for node in self._nodes[group]:
            node.remove()
        self._nodes[group] = []

    def _lines(
        self, group: str, name: str, segments: list[Segments], colour: Rgb, thickness: float = LINE
    ) -> None:
        if not segments:
            return
        node = self._scene.add_line_segments(
            f"/{group}/{name}",
            np.concatenate(segments),
            colour,
            thickness=thickness,
            thickness_units="screen",
        )
        self._nodes[group].append(node)

    def _draw_plan(self, plan: LivePlan, bodies: Bodies, aimed: list[int]) -> None:
        """Draw on the table where the bodies should go; the next push is an arrow over them."""
        if len(plan.start) != len(bodies) or not len(plan.predicted):
            return
        shown = sorted({*aimed, *pushed_bodies(plan.pushes).tolist()})
        self._draw_others(plan, aimed)
        paths = np.concatenate([plan.start[None], plan.predicted])[:, :, POSITION]
        chosen = line(paths[:, shown].swapaxes(0, 1), FLOOR + LIFT)
        self._lines("plan", "chosen", [chosen], PREDICTED)
        height = FLOOR + 2 * LIFT
        after = {"next": (plan.predicted[0], PREDICTED, LINE)}
        if len(plan.predicted) > 1:
            after["last"] = plan.predicted[-1], LATER, THIN
        for name, (scene, colour, thickness) in after.items():
            rings = [ring(bodies.shapes[body].placed(scene[body]), height) for body in shown]
            self._lines("plan", name, rings, colour, thickness)
        if plan.regions is not None:
            radii = plan.regions[0]
            rings = [
                circle(plan.predicted[0, b, POSITION], float(radii[b]), height)
                for b in shown
                if radii[b] > 0.0
            ]
            self._lines("plan", "regions", rings, REGION, THIN)
        self._draw_push(plan, bodies)

    def _draw_others(self, plan: LivePlan, aimed: list[int]) -> None:
        """Draw where a few other sequences lead the bodies of the goal."""
        if not len(plan.places) or not aimed:
            return
        places = plan.places[np.argsort(plan.costs)[:FEW]]
        start = np.broadcast_to(plan.start[:, POSITION], (len(places), 1, len(plan.start), 2))
        paths = np.concatenate([start, places], axis=1)[:, :, aimed]
        self._lines("plan", "others", [line(paths.swapaxes(1, 2), FLOOR)], OTHERS, THIN)

    def _draw_push(self, plan: LivePlan, bodies: Bodies) -> None:
        push = plan.pushes[0]
        if push[LENGTH] <= 0.0:
            return
        start, heading = strokes(plan.start, push, LIMITS, bodies)
        ends = lifted(np.stack([start, start + push[LENGTH] * unit(heading)]), TOOL)
        arrow = self._scene.add_arrows(
            "/plan/push",
            ends[None],
            CHOSEN,
            shaft_radius=0.0035,
            head_radius=0.010,
            head_length=0.024,
        )
        self._nodes["plan"].append(arrow)

    def _draw_result(self, result: LiveResult, bodies: Bodies) -> None:
        """Draw where the last push was expected to lead: the bodies show where it led."""
        after = result.after
        if len(after) != len(bodies):
            return
        shown = self._compared(result)
        for name, scene, colour in (
            ("physics", result.physics, PHYSICS),
            ("predicted", result.planned, PREDICTED),
        ):
            if scene is not None and len(scene) == len(after):
                height = DISK_HEIGHT + FLOOR
                rings = [ring(bodies.shapes[b].placed(scene[b]), height) for b in shown]
                self._lines("result", name, rings, colour, THIN)

    @staticmethod
    def _compared(result: LiveResult) -> list[int]:
        """Return the bodies that the push was to move, or that it moved otherwise."""
        expected = result.planned if result.planned is not None else result.physics
        if expected is None or expected.shape != result.after.shape:
            return []
        before = result.before if result.before is not None else expected
        moved = _way(result.after, before) > MOVED
        return np.flatnonzero(moved | (_way(expected, before) > MOVED)).tolist()


def _way(scene: Scene, other: Scene) -> np.ndarray:
    return np.asarray(np.hypot(*(scene[:, POSITION] - other[:, POSITION]).T))


def _aimed(known: LiveState, count: int) -> list[int]:
    """Return the bodies of the goal."""
    poses = () if known.aim is None else known.aim.poses
    return [pose.body for pose in poses if pose.body < count]
