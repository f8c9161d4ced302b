"""What messages mean for the page: they become `LiveState`, with the pushes of an episode."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
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
from sain_core.types import Scene as SceneArray
from sain_core.wire.bodies import decode_bodies
from sain_core.wire.learning import decode_learning
from sain_core.wire.scene_door import SeenScene
from sain_interfaces.msg import (
    Bodies,
    Goal,
    Learning,
    Plan,
    PushResult,
    Scene,
    WorldParameters,
)
from sain_live.orders import first_aim
from sain_live.state import (
    MOST_POINTS,
    FixedPose,
    GhostLine,
    Level,
    LiveArm,
    LiveCurves,
    LivePlan,
    LiveResult,
    LiveState,
    Phase,
    largest_error,
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
    """Follows ``/diagnostics``."""

    def __init__(self, known: LiveState) -> None:
        """Begin with nobody."""
        self._known = known
        self._levels: dict[str, tuple[bytes, str]] = {}

    def hear(self, message: DiagnosticArray) -> None:
        """Tell what is new; while the graph starts, no trouble of a node is a fault."""
        for status in message.status:
            values: dict[str, Any] = {pair.key: pair.value for pair in status.values}
            engine = values.get("engine", self._known.engine)
            if engine != self._known.engine:
                self._known.update(engine=engine)
            level, before = bytes(status.level), self._levels.get(status.name, (OK, ""))
            if (level, status.message) == before or status.message == "starting":
                continue
            if level != OK:
                first, starting = status.name not in self._levels, self._known.starting
                if first or not starting:  # else the page says all the time what it waits for
                    kind = Level.NOTE if first or starting else Level.FAULT
                    self._known.tell(kind, f"{plain_name(node_of(status))}: {status.message}")
            elif before[0] != OK:
                self._known.tell(Level.NOTE, f"{plain_name(node_of(status))}: {status.message}")
            self._levels[status.name] = level, status.message


def plain_name(node: str) -> str:
    """Return what a reader calls a node."""
    name = node.rpartition("/")[2]
    return PLAIN.get(name, name)


UNKNOWN = float("nan")


@dataclass(eq=False)
class PushStory:
    """All about one push, as far as it has come."""

    distance: float = UNKNOWN  # [mm], before it
    left: float = UNKNOWN  # [mm], after it
    planning: float = UNKNOWN  # [ms]
    planned: SceneArray | None = None
    physics: SceneArray | None = None
    before: SceneArray | None = None
    after: SceneArray | None = None


class Stories:
    """The pushes of an episode, by their ids."""

    def __init__(self) -> None:
        """Begin with none."""
        self._stories: dict[int, PushStory] = {}

    def clear(self) -> None:
        """Begin another episode."""
        self._stories.clear()

    def of(self, push_id: int) -> PushStory:
        """Return what is known of a push."""
        if push_id not in self._stories and len(self._stories) >= MOST_POINTS:
            del self._stories[next(iter(self._stories))]
        return self._stories.setdefault(push_id, PushStory())

    def result(self, push_id: int) -> LiveResult | None:
        """Return a push that was carried out, beside its predictions; None: it was not yet."""
        story = self.of(push_id)
        if story.after is None:
            return None
        return LiveResult(push_id, story.after, story.before, story.planned, story.physics)

    def curves(self) -> LiveCurves:
        """Return the charts."""
        stories = list(self._stories.values())
        if not stories:
            return LiveCurves()
        planned, physics = (
            (
                UNKNOWN,
                *(
                    UNKNOWN if s.after is None else largest_error(getattr(s, name), s.after)
                    for s in stories
                ),
            )
            for name in ("planned", "physics")
        )
        return LiveCurves(
            (*(s.distance for s in stories), stories[-1].left),
            planned,
            physics,
            (UNKNOWN, *(s.planning for s in stories)),
        )


MOST_SHAPES: Final = 16  # episodes whose shapes are kept until their scenes come
Take = Callable[[Any], None]
RECENT: Final = 5.0  # [s]
WORLD: Final = "world"
WALL_CLOCK: Final = 1e8  # [s]; no simulation is so long
MOST_FRAMES: Final = 100
MOST_MARKERS: Final = 100
LARGEST_PICTURE: Final = 640  # pixels, its width
LONGEST_DESCRIPTION: Final = 4_000_000  # characters of a URDF
ENDED: Final = {Plan.REACHED: Phase.REACHED, Plan.EXHAUSTED: Phase.PAUSED}
SILENT: Final = (ErrorCode.OK, ErrorCode.UNKNOWN, ErrorCode.CANCELLED)


class Hearing:
    """Writes into `LiveState` what messages say, of a running graph or of a recording.

    Attributes:
        handlers: what takes the messages of a topic, by its name.
    """

    def __init__(
        self,
        known: LiveState,
        shapes_come: Callable[[], bool] = lambda: True,
        offers_goal: bool = True,
    ) -> None:
        """Know nothing yet.

        Args:
            known: where it is written.
            shapes_come: tells whether each episode begins with its bodies.
            offers_goal: whether a scene without a goal gets one, to be dragged.
        """
        self._known, self._shapes_come, self._offers_goal = known, shapes_come, offers_goal
        self._stories = Stories()
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
            "/diagnostics": (DiagnosticArray, Health(known).hear),
        }

    def _on_learning(self, message: Learning) -> None:
        before, learned = self._known.learned, decode_learning(message)
        self._known.update(learned=learned)
        known = set(before.events) if before is not None else set(learned.events[:-1])
        for event in learned.events:
            if event not in known:
                self._known.tell(Level.NOTE, f"learner, push {event[0]}: {event[1]}: {event[2]}")

    def _on_scene(self, message: Scene) -> None:
        seen = replace(SeenScene.of(message), message=None)  # thousands are kept
        if message.episode_id not in self._shapes and self._shapes_come():
            self._early = seen
            return
        self._see(seen)

    def _see(self, seen: SeenScene) -> None:
        known, before = self._known, self._known.scene
        shapes = self._shapes.get(seen.episode_id)
        if shapes is not None and self._bodies_of != seen.episode_id:
            self._bodies_of = seen.episode_id
            known.update(bodies=shapes)
        if len(known.bodies) != len(seen.disks):
            known.update(bodies=CoreBodies.disks(len(seen.disks)))
        if before is None or before.episode_id != seen.episode_id:
            self._begin(seen)
        if seen.settled:
            self._settled = seen
        if before is None and seen.stamp > WALL_CLOCK:
            known.update(epoch=seen.stamp)
        known.update(scene=seen)
        aim = None if known.aim is None else known.aim.fitted(len(seen.disks))
        if aim is None or any(pose.body >= len(seen.disks) for pose in aim.poses):
            aim = first_aim(seen.disks, known.bodies) if self._offers_goal else None
        if aim != known.aim:
            known.update(aim=aim)
        if known.phase is Phase.WAITING:
            known.update(phase=Phase.PAUSED)

    def _begin(self, seen: SeenScene) -> None:
        """Forget the episode before."""
        self._stories.clear()
        self._goal_id = None
        if not self._offers_goal and self._goal_of not in (0, seen.episode_id):
            self._known.update(aim=None)
        self._known.update(plan=None, result=None, curves=self._stories.curves(), pushes=0)

    def _on_bodies(self, message: Bodies) -> None:
        bodies, episode = decode_bodies(message), message.episode_id
        self._shapes.pop(episode, None)
        for other in [one for one in self._shapes if one != self._bodies_of][: 1 - MOST_SHAPES]:
            del self._shapes[other]
        self._shapes[episode] = bodies
        if episode == self._bodies_of:
            self._known.update(bodies=bodies)
        early, self._early = self._early, None
        if early is not None and early.episode_id == episode:
            self._see(early)
        elif early is not None:
            self._early = early

    def _on_joints(self, message: JointState) -> None:
        names, positions = len(message.name), len(message.position)
        if names != positions:
            raise InvalidInputError(f"{names} names and {positions} positions; allowed: as many")
        self._known.update(joints=dict(zip(message.name, message.position, strict=True)))

    def _on_description(self, message: String) -> None:
        known = self._known
        if len(message.data) > LONGEST_DESCRIPTION:
            known.tell(Level.FAULT, f"the arm is not drawn: {len(message.data)} characters of URDF")
        elif known.arm is None or known.arm.description != message.data:
            known.update(arm=LiveArm(message.data, self._frames))

    def _on_fixed_frames(self, message: TFMessage) -> None:
        """Take what stands in the world: the arm's root, perhaps a camera."""
        found = dict(self._frames)
        for frame in message.transforms[:MOST_FRAMES]:
            if frame.header.frame_id.rpartition("/")[2] == WORLD:
                place, turn = frame.transform.translation, frame.transform.rotation
                pose = (place.x, place.y, place.z), (turn.w, turn.x, turn.y, turn.z)
                found[frame.child_frame_id.rpartition("/")[2]] = pose
        if found == self._frames or len(found) > MOST_FRAMES:
            return
        self._frames = found
        if (arm := self._known.arm) is not None:
            self._known.update(arm=LiveArm(arm.description, found))

    def _on_ghost(self, message: MarkerArray) -> None:
        """Take the lines of a way; an empty one after them forgets them."""
        lines = []
        for marker in message.markers[:MOST_MARKERS]:
            points = np.array([(p.x, p.y, p.z) for p in marker.points[:MOST_POINTS]])
            if marker.type != Marker.LINE_STRIP or len(points) < 2:
                continue
            colour = [marker.color.r, marker.color.g, marker.color.b]
            if not (np.isfinite(points).all() and np.isfinite([*colour, marker.scale.x]).all()):
                raise InvalidInputError(f"line {marker.ns} {marker.id} has NaN or Inf")
            red, green, blue = np.clip(np.multiply(colour, 255.0), 0, 255).astype(int).tolist()
            lines.append(GhostLine(points, marker.scale.x, (red, green, blue)))
        self._known.update(ghost=tuple(lines))

    def on_picture(self, message: Image) -> None:
        """Take what the camera saw, made so small that a browser gets it quickly."""
        height, width = message.height, message.width
        if message.encoding not in ("bgr8", "rgb8") or len(message.data) != 3 * height * width:
            raise InvalidInputError(
                f"an image of {width} x {height} px in {message.encoding!r} with"
                f" {len(message.data)} bytes; allowed: bgr8, rgb8"
            )
        pixels = np.frombuffer(message.data, dtype=np.uint8).reshape(height, width, 3)
        step = max(1, -(-width // LARGEST_PICTURE))
        picture = pixels[::step, ::step, :: -1 if message.encoding == "bgr8" else 1]
        self._known.update(picture=np.ascontiguousarray(picture))

    def _on_goal(self, message: Goal) -> None:
        known = self._known
        aim = wire.decode_goal(message).fitted(len(known.bodies))
        self._goal_of = message.episode_id
        again = aim == known.aim and message.goal_id == self._goal_id
        if aim != known.aim:
            known.update(aim=aim)
        if again:  # heard twice, perhaps after its first plan
            return
        self._count_anew(message.goal_id)
        sent, scene = codec.decode_time(message.header.stamp), known.scene
        if scene is not None and abs(sent - scene.stamp) < RECENT:  # else it was latched long ago
            known.update(phase=Phase.PLANNING, why="")

    def _count_anew(self, goal_id: int) -> None:
        """Count the pushes of another goal."""
        self._goal_id = goal_id
        self._known.update(pushes=0)

    def _on_plan(self, message: Plan) -> None:
        known = self._known
        if message.goal_id != self._goal_id:  # plans may overtake their goal
            self._count_anew(message.goal_id)
        if message.status == Plan.PUSH:
            self._on_push(message)
            return
        error = message.error_message if message.error_code not in SILENT else ""
        phase = ENDED.get(message.status, Phase.ENDED if error else Phase.PAUSED)
        why = f"{known.pushes} pushes" if phase is Phase.REACHED else error
        known.update(phase=phase, why=why, plan=None)
        if error:
            known.tell(Level.REFUSAL, f"planner: {error}")

    def _on_push(self, message: Plan) -> None:
        known = self._known
        pushes, predicted = wire.decode_plan(message)
        settled = self._settled
        start = settled if settled and settled.scene_id == message.scene_id else known.scene
        horizon, disks = message.horizon, message.disks
        if start is None or start.episode_id != message.episode_id or disks != len(start.disks):
            return
        story = self._stories.of(message.push_id)
        story.distance = 1e3 * message.goal_distance
        story.planning = 1e3 * message.planning_time
        story.planned = predicted[0] if len(predicted) else None
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
        known.update(
            curves=self._stories.curves(),
            pushes=known.pushes + 1,
            model=known.model or message.dynamics,
        )
        if story.after is None:  # a plan that is completed late may come after its push's result
            known.update(plan=plan, phase=Phase.PUSHING, why=message.concern)

    def _on_result(self, message: PushResult) -> None:
        known = self._known
        if message.error_code != ErrorCode.OK:
            known.tell(Level.REFUSAL, f"push refused: {message.error_message}")
            known.update(pushes=max(known.pushes - 1, 0))
            return
        story = self._stories.of(message.push_id)
        story.before, _, story.after = wire.decode_result(message)
        if message.prediction.error_code == ErrorCode.OK:
            story.physics = wire.decode_disks(message.prediction.disks)
        if (judged := known.judge(story.after)) is not None:
            story.left = 1e3 * judged.distance
        known.update(result=self._stories.result(message.push_id), curves=self._stories.curves())
        if known.phase is Phase.PUSHING:
            known.update(phase=Phase.PLANNING)

    def _on_world(self, message: WorldParameters) -> None:
        self._known.update(world=message.world)
