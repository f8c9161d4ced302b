"""What the page hears of the graph: messages become `LiveState`."""

from collections.abc import Callable
from threading import Lock
from typing import Any, Final

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from sain_core import wire
from sain_core.errors import ErrorCode
from sain_core.ros import codec
from sain_core.ros.qos import LATCHED, LATCHED_QUEUE, QUEUE, RELIABLE
from sain_core.ros.reception import Reception
from sain_core.scene import STATE_SIZE
from sain_core.shapes.bodies import Bodies as CoreBodies
from sain_core.shapes.received import decode_bodies
from sain_interfaces.msg import (
    Bodies,
    Goal,
    Plan,
    PushPrediction,
    PushResult,
    Scene,
    WorldParameters,
)
from sain_live.aims import Aim, first_aim
from sain_live.ros.health import Health
from sain_live.ros.polling import Polling
from sain_live.ros.pushes import Stories
from sain_live.state import Kind, LiveArm, LivePlan, LiveScene, LiveState, Phase
from sain_mppi.ros.goal_message import decode_task

Take = Callable[[Any], None]
RATE: Final = 60.0  # [Hz], looks for new scenes and joints
RECENT: Final = 5.0  # [s]
WORLD: Final = "world"
LONGEST_DESCRIPTION: Final = 4_000_000  # characters of a URDF
ENDED: Final = {Plan.REACHED: Phase.REACHED, Plan.EXHAUSTED: Phase.PAUSED}
SILENT: Final = (ErrorCode.OK, ErrorCode.UNKNOWN, ErrorCode.CANCELLED)


class Hearing:
    """Listens to all that a viewer sees."""

    def __init__(self, node: Node, known: LiveState) -> None:
        """Listen from now on."""
        self._node, self._known = node, known
        self._stories = Stories()
        self._bodies_of = 0  # episode
        self._goal_id: int | None = None  # that the pushes are counted of
        self._early: LiveScene | None = None  # whose bodies are not known yet
        self._settled: LiveScene | None = None
        self._root: tuple[Any, ...] = ()  # place and turn of the arm's, once they are known
        self._lock = Lock()  # scenes come on a thread of their own
        self._polling = Polling(node, reception := Reception(node), RATE)
        self._polling.listen(Scene, "scene", self._locked(self._on_scene))
        self._polling.listen(JointState, "joint_states", self._on_joints)

        def listen(kind: type, topic: str, callback: Take, qos: QoSProfile = RELIABLE) -> None:
            reception.listen(kind, topic, self._locked(callback), qos)

        listen(Bodies, "shapes", self._on_bodies, LATCHED)
        for qos in (LATCHED_QUEUE, RELIABLE):  # as the planner: the same one twice is no harm
            listen(Goal, "goal", self._on_goal, qos)
        listen(Plan, "plan", self._on_plan)
        listen(PushResult, "push_result", self._on_result, QUEUE)
        listen(PushPrediction, "physics_prediction", self._on_prediction)
        listen(WorldParameters, "world_parameters", self._on_world, LATCHED)
        listen(TFMessage, "/tf_static", self._on_fixed_frames, LATCHED_QUEUE)
        listen(DiagnosticArray, "/diagnostics", Health(known).hear)
        # Longer than texts elsewhere may be, so with a limit of its own.
        node.create_subscription(String, "robot_description", self._on_description, LATCHED)
        self._polling.start()

    def close(self) -> None:
        """Listen no more."""
        self._polling.close()

    def _locked(self, callback: Take) -> Take:
        def take(message: Any) -> None:
            with self._lock:
                callback(message)

        return take

    def _on_scene(self, message: Scene) -> None:
        time = codec.decode_time(message.header.stamp)
        ids = message.episode_id, message.scene_id
        seen = LiveScene(wire.decode_disks(message.disks), *ids, message.settled, time)
        if self._bodies_of != message.episode_id and self._node.count_publishers("shapes"):
            self._early = seen
            return
        self._see(seen)

    def _see(self, seen: LiveScene) -> None:
        known, before = self._known, self._known.scene
        if known.bodies is None or len(known.bodies) != len(seen.disks):
            known.update(bodies=CoreBodies.disks(len(seen.disks)))
        assert known.bodies is not None
        if before is None or before.episode_id != seen.episode_id:
            self._begin(seen)
        if seen.settled:
            self._settled = seen
        known.update(scene=seen)
        aim = None if known.aim is None else known.aim.among(len(seen.disks))
        if aim is None or any(pose.body >= len(seen.disks) for pose in aim.poses):
            aim = first_aim(seen.disks, known.bodies)
        if aim is not None and not aim.same(known.aim):
            known.update(aim=aim)
        if known.phase is Phase.WAITING:
            known.update(phase=Phase.PAUSED)

    def _begin(self, seen: LiveScene) -> None:
        """Forget the episode before."""
        self._stories.clear()
        self._goal_id = None
        self._known.update(plan=None, result=None, curves=self._stories.curves(), pushes=0)

    def _on_bodies(self, message: Bodies) -> None:
        self._bodies_of = message.episode_id
        self._known.update(bodies=decode_bodies(message))
        early, self._early = self._early, None
        if early is not None and early.episode_id == message.episode_id:
            self._see(early)

    def _on_joints(self, message: JointState) -> None:
        self._known.update(joints=dict(zip(message.name, message.position, strict=True)))

    def _on_description(self, message: String) -> None:
        known = self._known
        if len(message.data) > LONGEST_DESCRIPTION:
            known.tell(Kind.FAULT, f"the arm is not drawn: {len(message.data)} characters of URDF")
        elif known.arm is None or known.arm.description != message.data:
            known.update(arm=LiveArm(message.data, *self._root))

    def _on_fixed_frames(self, message: TFMessage) -> None:
        """Take where the arm's root stands: the first frame that hangs on the world."""
        for frame in message.transforms:
            if frame.header.frame_id.rpartition("/")[2] == WORLD:
                place, turn = frame.transform.translation, frame.transform.rotation
                self._root = (place.x, place.y, place.z), (turn.w, turn.x, turn.y, turn.z)
                if (arm := self._known.arm) is not None:
                    self._known.update(arm=LiveArm(arm.description, *self._root))
                return

    def _on_goal(self, message: Goal) -> None:
        task, known = decode_task(message), self._known
        aim = Aim(task.goal, task.tolerance)
        if known.bodies is not None:
            aim = aim.among(len(known.bodies))
        again = aim.same(known.aim) and message.goal_id == self._goal_id
        if not aim.same(known.aim):
            known.update(aim=aim)
        if again:  # heard twice, perhaps after its first plan
            return
        self._count_anew(message.goal_id)
        sent, scene = codec.decode_time(message.header.stamp), known.scene
        if scene is not None and abs(sent - scene.time) < RECENT:  # else it was latched long ago
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
            known.tell(Kind.REFUSAL, f"planner: {error}")

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
        if message.fallback:
            known.tell(Kind.FAULT, f"the physics prior plans: {message.error_message}")

    def _on_result(self, message: PushResult) -> None:
        known = self._known
        if message.error_code != ErrorCode.OK:
            known.tell(Kind.REFUSAL, f"push refused: {message.error_message}")
            known.update(pushes=max(known.pushes - 1, 0))
            return
        story = self._stories.of(message.push_id)
        story.before, _, story.after = wire.decode_result(message)
        known.update(result=self._stories.result(message.push_id), curves=self._stories.curves())
        if known.phase is Phase.PUSHING:
            known.update(phase=Phase.PLANNING)

    def _on_prediction(self, message: PushPrediction) -> None:
        if message.error_code != ErrorCode.OK:
            return
        self._stories.of(message.push_id).physics = wire.decode_disks(message.disks)
        result = self._stories.result(message.push_id)
        known = self._known
        latest = known.result is None or known.result.push_id == message.push_id
        if result is not None and latest:
            known.update(result=result, curves=self._stories.curves())

    def _on_world(self, message: WorldParameters) -> None:
        self._known.update(world=message.world)
