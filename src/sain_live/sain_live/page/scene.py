"""What the page shows on the table: bodies, plan, the last push, and goals that can be dragged."""

from operator import is_not
from typing import Any, Final

import numpy as np
import viser

from sain_core.errors import SainError
from sain_core.goal import BodyPose, Goal
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene
from sain_core.view.scenes import bodies_in, goal_marks, plan_things, predictions, stage
from sain_core.view.things import GoalMark, Look, Thing
from sain_core.world import PushRecord
from sain_live.goals import FEASIBILITY, check_goal
from sain_live.page.drawing import LOW, ThingsView, draw_goal, heading_of, sky, upright
from sain_live.requests import Send, SetGoal
from sain_live.state import GhostLine, Level, LivePlan, LiveState

FEW: Final = 6  # other sequences that are shown, the cheapest
GHOST_WIDTH: Final = 0.004  # [m], at most: these lines are not transparent


class SceneView:
    """Draws the scene, as far as it is new."""

    def __init__(self, server: viser.ViserServer) -> None:
        server.scene.set_background_image(sky(256), format="png")
        self._view = ThingsView(server.scene)
        self._view.show("stage", stage(FEASIBILITY))
        self._server, self._ghost = server, list[Any]()
        self._shown: dict[str, tuple[Any, ...]] = {}

    def show(self, state: LiveState) -> None:
        """Draw what has changed."""
        seen, bodies = state.scene, state.bodies
        whole = seen is not None and len(bodies) == len(seen.disks)
        if seen is not None and whole and self._is_new("bodies", seen.disks, bodies):
            self._view.show_bodies(bodies_in(seen.disks, bodies))
        if self._is_new("plan", state.plan):
            plan = state.plan
            self._view.show("plan", [] if plan is None else _plan(state, plan))
        if self._is_new("result", state.result):
            result = state.result
            self._view.show("result", [] if result is None else _result(result, bodies))

        if self._is_new("ghost", state.ghost):
            self._draw_ghost(state.ghost)

    def _draw_ghost(self, lines: tuple[GhostLine, ...]) -> None:
        for node in self._ghost:
            node.remove()
        self._ghost = [
            self._server.scene.add_line_segments(
                f"/ghost/{number}",
                np.stack([line.points[:-1], line.points[1:]], axis=1),
                line.colour,
                thickness=min(line.width, GHOST_WIDTH),
            )
            for number, line in enumerate(lines)
        ]

    def _is_new(self, name: str, *now: object) -> bool:
        """Whether something is not what it was at the last call."""
        before, self._shown[name] = self._shown.get(name), now
        return before is None or any(map(is_not, before, now))


def _plan(state: LiveState, plan: LivePlan) -> list[Thing]:
    if len(plan.start) != len(state.bodies) or not len(plan.predicted):
        return []
    aim = state.aim
    goal = aim if aim is not None and max(aim.wanted) < len(state.bodies) else None
    made = plan_things(
        plan.start,
        state.bodies,
        goal,
        plan.pushes,
        plan.predicted,
        plan.regions,
        plan.places[np.argsort(plan.costs)[:FEW]],
    )
    return [thing for thing in made if not isinstance(thing, GoalMark)]  # `GoalsView` has them


def _result(push: PushRecord, bodies: Bodies) -> list[Thing]:
    if len(push.after) != len(bodies):
        return []
    before, after = push.before, push.after
    return [
        *predictions(before, after, push.physics, bodies, Look.PHYSICS),
        *predictions(before, after, push.predicted, bodies, Look.EXPECTED),
    ]


HANDLE: Final = 0.11  # [m], length of the arrows

START, END = "start", "end"


class GoalsView:
    """Draws the goal and takes what viewers do with it."""

    def __init__(self, server: viser.ViserServer, state: LiveState, send: Send | None) -> None:
        """Draw nothing yet; without `send`, goals have no handles."""
        self._server = server
        self._state = state
        self._send = send
        self._handles: dict[int, Any] = {}
        self._made: tuple[Any, ...] | None = None
        self._shown: Goal | None = None
        self._dragged: dict[int, int] = {}  # bodies, by the viewer who drags

    def show(self, state: LiveState) -> None:
        """Draw what has changed; a goal that is being dragged stays with its viewer."""
        aim, seen, bodies = state.aim, state.scene, state.bodies
        if aim is None or seen is None:
            self._clear()
            return
        if any(pose.body >= len(bodies) for pose in aim.poses) or len(bodies) != len(seen.disks):
            return  # of another episode
        free = tuple((p.body, p.heading is None, p.tolerance) for p in aim.poses)
        made = (bodies, seen.episode_id, free)
        if self._made != made:
            self._clear()
            for pose in aim.poses:
                self._handles[pose.body] = self._make(pose, seen.disks, bodies)
            self._made = made
        if aim is not self._shown:
            self._shown = aim
            for pose in aim.poses:
                if pose.body not in self._dragged.values():
                    self._place(pose)

    def _clear(self) -> None:
        for handle in self._handles.values():
            handle.remove()
        self._handles, self._made, self._shown = {}, None, None
        self._dragged.clear()

    def _place(self, pose: BodyPose) -> None:
        handle = self._handles[pose.body]
        handle.position = (pose.x, pose.y, LOW)
        handle.wxyz = upright(pose.heading or 0.0)

    def _make(self, pose: BodyPose, scene: Scene, bodies: Bodies) -> Any:
        (mark,) = goal_marks(Goal((pose,)), scene, bodies)
        name = f"/goals/{pose.body}"
        handle = self._handle(name, HANDLE + mark.body.size, pose)
        draw_goal(self._server.scene, name, mark)
        return handle

    def _handle(self, name: str, size: float, pose: BodyPose) -> Any:
        """Add what carries a goal, and moves it where it can be dragged."""
        if self._send is None:
            return self._server.scene.add_frame(name, show_axes=False)
        handle = self._server.scene.add_transform_controls(
            name,
            scale=size,
            line_width=3.0,
            active_axes=(True, True, False),
            disable_axes=True,
            disable_rotations=pose.heading is None,
            depth_test=False,
            opacity=0.9,
        )
        handle.on_update(self._on_update(pose.body))
        return handle

    def _on_update(self, body: int) -> Any:
        async def take(event: viser.TransformControlsEvent) -> None:
            viewer = -1 if event.client_id is None else event.client_id
            if event.phase == START:
                self._dragged[viewer] = body
            elif event.phase == END:
                self._dragged.pop(viewer, None)
                left = viewer not in self._server.get_clients()
                self.drop(body, event.target.position, event.target.wxyz, left)

        return take

    def drop(self, body: int, position: Any, turn: Any, left: bool) -> None:
        """Take a goal where a viewer let it go; where that cannot be, it snaps back."""
        state = self._state
        aim, seen, bodies = state.aim, state.scene, state.bodies
        if aim is None or seen is None or self._send is None:
            return
        if left:
            self._snap_back(body, "the viewer who dragged it left; it is where it was")
            return
        try:
            moved = aim.with_pose(body, float(position[0]), float(position[1]), heading_of(turn))
            check_goal(moved, seen.disks, bodies)
        except (SainError, IndexError, TypeError, ValueError) as error:  # viewers send anything
            self._snap_back(body, f"{error}")
            return
        state.update(aim=moved)
        self._send(SetGoal(moved))

    def _snap_back(self, body: int, why: str) -> None:
        self._state.tell(Level.REFUSAL, f"goal of body {body}: {why}")
        aim = self._state.aim
        for pose in () if aim is None else aim.poses:
            if pose.body == body and body in self._handles:
                self._place(pose)
