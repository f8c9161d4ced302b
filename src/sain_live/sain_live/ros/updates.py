"""What messages mean for the page: they become `LiveState`, with the pushes of an episode."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import nan
from typing import Any, Final

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import Marker, MarkerArray

from sain_core import wire
from sain_core.errors import ErrorCode, InvalidInputError
from sain_core.ros import codec
from sain_core.ros.node_main import OK, node_of
from sain_core.scene import STATE_SIZE
from sain_core.shapes.bodies import Bodies as CoreBodies
from sain_core.wire.bodies import decode_bodies
from sain_core.wire.images import decode_colour
from sain_core.wire.learning import decode_learning
from sain_core.wire.scene_door import SeenScene
from sain_core.world import PushRecord
from sain_interfaces.msg import Bodies, Goal, Learning, Plan, PushResult, Scene, WorldParameters
from sain_live.goals import first_goal
from sain_live.state import (
    MOST_POINTS,
    FixedPose,
    GhostLine,
    Level,
    LiveArm,
    LiveCurves,
    LivePlan,
    LiveState,
    Phase,
)

PLAIN: Final = {
    "mppi_node": "planner",
    "model_node": "model",
    "sim_node": "simulator",
    "scene_node": "scenes",
    "learner_node": "learner",
    "arm_node": "arm",
}


class Health:
    """Writes what nodes report on ``/diagnostics`` into the log."""

    def __init__(self, state: LiveState) -> None:
        self._state = state
        self._levels: dict[str, tuple[bytes, str]] = {}

    def update(self, message: DiagnosticArray) -> None:
        """Log what is new; while the graph starts, no trouble of a node is a fault."""
        state = self._state
        for status in message.status:
            engines = [pair.value for pair in status.values if pair.key == "engine"]
            if engines and engines[0] != state.engine:
                state.update(engine=engines[0])
            level, before = bytes(status.level), self._levels.get(status.name, (OK, ""))
            if (level, status.message) == before or status.message == "starting":
                continue
            first, starting = status.name not in self._levels, bool(state.starting)
            recovered = level == OK and before[0] != OK
            # The page shows all the time what a graph that starts waits for.
            if recovered or (level != OK and (first or not starting)):
                kind = Level.NOTE if recovered or first or starting else Level.FAULT
                name = node_of(status).rpartition("/")[2]
                state.tell(kind, f"{PLAIN.get(name, name)}: {status.message}")
            self._levels[status.name] = level, status.message


MOST_SHAPES: Final = 16  # episodes whose shapes are kept until their scenes come
Take = Callable[[Any], None]
RECENT: Final = 5.0  # [s]
WORLD: Final = "world"
WALL_CLOCK: Final = 1e8  # [s]; no simulation is so long
LARGEST_PICTURE: Final = 640  # pixels, its width
ENDED: Final = {Plan.REACHED: Phase.REACHED, Plan.EXHAUSTED: Phase.PAUSED}
SILENT: Final = (ErrorCode.OK, ErrorCode.UNKNOWN, ErrorCode.CANCELLED)


class StateUpdater:
    """Writes into `LiveState` what messages state, of a running graph or of a recording.

    Attributes:
        handlers: what takes the messages of a topic, by its name.
    """

    def __init__(
        self,
        state: LiveState,
        shapes_come: Callable[[], bool] = lambda: True,
        offers_goal: bool = True,
    ) -> None:
        """Update this state.

        `shapes_come` returns whether each episode begins with its bodies. A scene without a goal
        gets one to be dragged, if the page offers it.
        """
        self._state, self._shapes_come, self._offers_goal = state, shapes_come, offers_goal
        self._pushes: dict[int, PushRecord] = {}  # of the episode, by their ids
        self._distances: dict[int, float] = {}  # [m] from the goal, when each was planned
        self._bodies_of = 0  # episode
        self._shapes: dict[int, CoreBodies] = {}  # of this episode and others, by episode
        self._goal_of = 0  # episode; 0: any
        self._goal_id: int | None = None  # that the pushes are counted of
        self._early: SeenScene | None = None  # whose bodies are not known yet
        self._settled: SeenScene | None = None
        self._frames: dict[str, FixedPose] = {}  # that hang on the world
        self.handlers: Mapping[str, tuple[type, Take]] = {
            "scene": (Scene, self._on_scene),
            "joint_states": (JointState, self._on_joints),
            "/joint_states": (JointState, self._on_joints),  # a robot's
            "shapes": (Bodies, self._on_bodies),
            "goal": (Goal, self._on_goal),
            "plan": (Plan, self._on_plan),
            "push_result": (PushResult, self._on_result),
            "world_parameters": (WorldParameters, self._on_world),
            "learning": (Learning, self._on_learning),
            "robot_description": (String, self._on_description),
            "/robot_description": (String, self._on_description),
            "ghost": (MarkerArray, self._on_ghost),
            "/tf_static": (TFMessage, self._on_fixed_frames),
            "/diagnostics": (DiagnosticArray, Health(state).update),
        }

    def _on_world(self, message: WorldParameters) -> None:
        self._state.update(world=message.world)

    def _on_learning(self, message: Learning) -> None:
        before, learned = self._state.learned, decode_learning(message)
        self._state.update(learned=learned)
        logged = set(before.events) if before is not None else set(learned.events[:-1])
        for event in learned.events:
            if event not in logged:
                self._state.tell(Level.NOTE, f"learner, push {event[0]}: {event[1]}: {event[2]}")

    def _on_scene(self, message: Scene) -> None:
        seen = replace(SeenScene.of(message), message=None)  # thousands are kept
        if message.episode_id not in self._shapes and self._shapes_come():
            self._early = seen
            return
        self._see(seen)

    def _see(self, seen: SeenScene) -> None:
        state, before = self._state, self._state.scene
        shapes = self._shapes.get(seen.episode_id)
        if shapes is not None and self._bodies_of != seen.episode_id:
            self._bodies_of = seen.episode_id
            state.update(bodies=shapes)
        if len(state.bodies) != len(seen.disks):
            state.update(bodies=CoreBodies.disks(len(seen.disks)))
        if before is None or before.episode_id != seen.episode_id:
            self._begin(seen)
        if seen.settled:
            self._settled = seen
        if before is None and seen.stamp > WALL_CLOCK:
            state.update(epoch=seen.stamp)
        state.update(scene=seen)
        aim = None if state.aim is None else state.aim.fitted(len(seen.disks))
        if aim is None or any(pose.body >= len(seen.disks) for pose in aim.poses):
            aim = first_goal(seen.disks, state.bodies) if self._offers_goal else None
        if aim != state.aim:
            state.update(aim=aim)
        if state.phase is Phase.WAITING:
            state.update(phase=Phase.PAUSED)

    def _begin(self, seen: SeenScene) -> None:
        """Forget the episode before."""
        self._pushes.clear()
        self._distances.clear()
        self._goal_id = None
        if not self._offers_goal and self._goal_of not in (0, seen.episode_id):
            self._state.update(aim=None)
        self._state.update(plan=None, result=None, curves=LiveCurves(), pushes=0)

    def _note(self, push_id: int, push: PushRecord) -> None:
        """Keep a push, as far as it has come, and draw the curves anew."""
        if push_id not in self._pushes and len(self._pushes) >= MOST_POINTS:
            del self._pushes[next(iter(self._pushes))]
        self._pushes[push_id] = push
        last = list(self._pushes.values())[-1]
        judged = None if last.code != ErrorCode.OK else self._state.judge(last.after)
        left = nan if judged is None else judged.distance
        distances = [self._distances.get(number, nan) for number in self._pushes]
        curves = LiveCurves.of(list(self._pushes.values()), [*distances, left])
        self._state.update(curves=curves)

    def _on_bodies(self, message: Bodies) -> None:
        bodies, episode = decode_bodies(message), message.episode_id
        self._shapes.pop(episode, None)
        for other in [one for one in self._shapes if one != self._bodies_of][: 1 - MOST_SHAPES]:
            del self._shapes[other]
        self._shapes[episode] = bodies
        if episode == self._bodies_of:
            self._state.update(bodies=bodies)
        if (early := self._early) is not None and early.episode_id == episode:
            self._early = None
            self._see(early)

    def _on_joints(self, message: JointState) -> None:
        names, positions = len(message.name), len(message.position)
        if names != positions:
            raise InvalidInputError(f"{names} names and {positions} positions; allowed: as many")
        self._state.update(joints=dict(zip(message.name, message.position, strict=True)))

    def _on_description(self, message: String) -> None:
        arm = self._state.arm
        if arm is None or arm.description != message.data:
            self._state.update(arm=LiveArm(message.data, self._frames))

    def _on_fixed_frames(self, message: TFMessage) -> None:
        """Take what stands in the world: the arm's root, perhaps a camera."""
        found = dict(self._frames)
        for frame in message.transforms:
            if frame.header.frame_id.rpartition("/")[2] == WORLD:
                place, turn = frame.transform.translation, frame.transform.rotation
                pose = (place.x, place.y, place.z), (turn.w, turn.x, turn.y, turn.z)
                found[frame.child_frame_id.rpartition("/")[2]] = pose
        self._frames = found
        if (arm := self._state.arm) is not None and arm.frames != found:
            self._state.update(arm=LiveArm(arm.description, found))

    def _on_ghost(self, message: MarkerArray) -> None:
        """Take the lines of a way; an empty one after them forgets them."""
        lines = []
        for marker in message.markers:
            points = np.array([(p.x, p.y, p.z) for p in marker.points])
            if marker.type != Marker.LINE_STRIP or len(points) < 2:
                continue
            colour = [marker.color.r, marker.color.g, marker.color.b]
            if not (np.isfinite(points).all() and np.isfinite([*colour, marker.scale.x]).all()):
                raise InvalidInputError(f"line {marker.ns} {marker.id} has NaN or Inf")
            red, green, blue = np.clip(np.multiply(colour, 255.0), 0, 255).astype(int).tolist()
            lines.append(GhostLine(points, marker.scale.x, (red, green, blue)))
        self._state.update(ghost=tuple(lines))

    def on_picture(self, message: Image) -> None:
        """Take what the camera saw, made so small that a browser gets it quickly."""
        step = max(1, -(-message.width // LARGEST_PICTURE))
        self._state.update(picture=decode_colour(message, step))

    def _on_goal(self, message: Goal) -> None:
        state = self._state
        aim = wire.decode_goal(message).fitted(len(state.bodies))
        self._goal_of = message.episode_id
        again = aim == state.aim and message.goal_id == self._goal_id
        if aim != state.aim:
            state.update(aim=aim)
        if again:  # heard twice, perhaps after its first plan
            return
        self._goal_id = message.goal_id
        state.update(pushes=0)
        sent, scene = codec.decode_time(message.header.stamp), state.scene
        if scene is not None and abs(sent - scene.stamp) < RECENT:  # else it was latched long ago
            state.update(phase=Phase.PLANNING, why="")

    def _on_plan(self, message: Plan) -> None:
        state = self._state
        if message.goal_id != self._goal_id:  # plans may overtake their goal
            self._goal_id = message.goal_id
            state.update(pushes=0)
        if message.status == Plan.PUSH:
            self._on_push(message)
            return
        error = message.error_message if message.error_code not in SILENT else ""
        phase = ENDED.get(message.status, Phase.ENDED if error else Phase.PAUSED)
        why = f"{state.pushes} pushes" if phase is Phase.REACHED else error
        state.update(phase=phase, why=why, plan=None)
        if error:
            state.tell(Level.REFUSAL, f"planner: {error}")

    def _on_push(self, message: Plan) -> None:
        state = self._state
        pushes, predicted = wire.decode_plan(message)
        settled = self._settled
        start = settled if settled and settled.scene_id == message.scene_id else state.scene
        horizon, disks = message.horizon, message.disks
        if start is None or start.episode_id != message.episode_id or disks != len(start.disks):
            return
        self._distances[message.push_id] = message.goal_distance
        push = self._pushes.get(message.push_id)  # its result may be here already
        if push is None:
            push = PushRecord(pushes[0], start.disks, start.disks, code=ErrorCode.UNKNOWN)
        expected = predicted[0] if len(predicted) else None
        push = replace(push, predicted=expected, planning_time=message.planning_time)
        self._note(message.push_id, push)
        count = len(message.other_costs)
        places = np.asarray(message.other_places, dtype=np.float64)
        regions = np.asarray(message.regions, dtype=np.float64)
        plan = LivePlan(
            message.push_id,
            start.disks,
            pushes,
            predicted.reshape(horizon, disks, STATE_SIZE),
            regions.reshape(horizon, disks) if len(regions) else None,
            np.asarray(message.other_costs),
            places.reshape(count, -1, disks, 2) if count else np.empty((0, horizon, disks, 2)),
        )
        state.update(pushes=state.pushes + 1, model=state.model or message.dynamics)
        if push.code != ErrorCode.OK:  # a plan that is completed late may come after the result
            state.update(plan=plan, phase=Phase.PUSHING, why=message.concern)

    def _on_result(self, message: PushResult) -> None:
        state = self._state
        if message.error_code != ErrorCode.OK:
            state.tell(Level.REFUSAL, f"push refused: {message.error_message}")
            state.update(pushes=max(state.pushes - 1, 0))
            return
        before, made, after = wire.decode_result(message)
        planned = self._pushes.get(message.push_id, PushRecord(made, before, after))
        push = replace(planned, push=made, before=before, after=after, code=ErrorCode.OK)
        if message.prediction.error_code == ErrorCode.OK:
            push = replace(push, physics=wire.decode_disks(message.prediction.disks))
        self._note(message.push_id, push)
        state.update(result=push)
        if state.phase is Phase.PUSHING:
            state.update(phase=Phase.PLANNING)
