"""The node of scenes: poses of bodies, however they were found, become `scene` and `shapes`."""

from functools import partial
from typing import Any, ClassVar

import numpy as np
from geometry_msgs.msg import PoseArray, PoseStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from tf2_msgs.msg import TFMessage
from vision_msgs.msg import Detection3DArray

from sain_core import wire
from sain_core.errors import ConfigError, InvalidInputError
from sain_core.guarding.ros.ownership import find_second_publisher
from sain_core.guarding.ros.reception import Reception, shortened
from sain_core.guarding.ros.state_file import StateFile, id_in
from sain_core.ros import codec
from sain_core.ros.markers import MarkerBoard, markers_of
from sain_core.ros.node_main import (
    ERROR,
    NAMESPACE,
    OK,
    WARN,
    Diagnostics,
    steady_timer,
)
from sain_core.ros.parameters import LiveParameters, read_parameters
from sain_core.ros.qos import LATCHED, LATCHED_QUEUE, QUEUE, RELIABLE, TRANSFORMS
from sain_core.scene import Table
from sain_core.view.scenes import bodies_in, table_top
from sain_core.view.things import Thing
from sain_interfaces.msg import Bodies, Push, PushResult
from sain_interfaces.msg import Scene as SceneMessage
from sain_vision.detection.sighting import Sighting
from sain_vision.ros.body_parameter import followed, read_body_file
from sain_vision.ros.detections import decode_detections, encode_sightings
from sain_vision.scene.body_track import Observed, TrackingConfig
from sain_vision.scene.frame_tree import FrameTree
from sain_vision.scene.scene_tracker import SceneTracker

SINGLE = ("scene", "shapes", "push_result", "poses")  # of which there must be one publisher
TABLE = Table()
NOTHING = np.zeros((0, 0, 2))
LOOK = 0.1  # [s] between looks at the age of the poses
LOOK_AROUND = 0.5  # [s]
CAMERA = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)  # hears reliable ones, too


class SceneNode(Node):
    """Follows the bodies and publishes them with the ids that pushes refer to."""

    awaits: ClassVar = False

    def __init__(self, **options: Any) -> None:
        super().__init__("scene_node", namespace=NAMESPACE, **options)
        self.config = config = read_parameters(self, TrackingConfig)
        self.bodies = read_body_file(config.bodies)
        self.state = StateFile(self, config.state_file)
        ids = self._ids_left()
        self.tracker = SceneTracker(self.bodies, config, ids)
        self.kept, self.trouble, self.conflict = ids, "", ""
        self.last: SceneMessage | None = None
        self.shapes_publisher = self.create_publisher(Bodies, "shapes", LATCHED)
        self.scene_publisher = self.create_publisher(SceneMessage, "scene", RELIABLE)
        self.estimates = self.create_publisher(Detection3DArray, "estimates", RELIABLE)
        self.markers = MarkerBoard(self, "markers")
        self._listen()
        steady_timer(self, LOOK, self._on_look)
        steady_timer(self, LOOK_AROUND, self._look_around)
        LiveParameters(self, config, followed(self, self._use))
        self.ready = f"{len(self.bodies.names)} bodies, {self.source}"
        if not self.bodies.weighed:
            self.ready += "; not all masses are known: give planner and model unknown:=mass"

    def _use(self, config: TrackingConfig) -> None:
        """Follow the bodies that another file states, from a new episode on."""
        bodies = read_body_file(config.bodies)
        sources = [
            (any(one.frames), tuple(filter(None, one.topics))) for one in (bodies, self.bodies)
        ]
        if sources[0] != sources[1]:
            raise ConfigError("poses come from elsewhere; start the node anew")
        self._unsettle()
        ids = self.tracker.episode_id, self.tracker.scene_id
        self.config, self.bodies = config, bodies
        self.tracker = SceneTracker(bodies, config, ids)

    def _ids_left(self) -> tuple[int, int]:
        """Return the ids of the process before; 0: there was none."""
        if not (left := self.state.read()):
            return 0, 0
        with self.state.decoding():
            return id_in(left, "episode_id"), id_in(left, "scene_id")

    def _listen(self) -> None:
        self.reception = reception = Reception(self)
        self.diagnostics = Diagnostics(self, "perception", more=lambda: reception.figures)
        reception.listen(Push, "push", self._on_push, QUEUE)
        reception.listen(PushResult, "push_result", self._on_result, QUEUE)
        bodies, self.source = self.bodies, "detections"
        self.tree = FrameTree(self.config.frame)
        if any(bodies.frames):
            self.source = "frames on /tf"
            reception.listen(TFMessage, "/tf", self._on_tf, TRANSFORMS, self._ignore)
            static = partial(self._on_tf, static=True)
            reception.listen(TFMessage, "/tf_static", static, LATCHED_QUEUE, self._ignore)
        for body, topic in enumerate(bodies.topics):
            if topic:
                hear = partial(self._on_pose, body)
                reception.listen(PoseStamped, topic, hear, CAMERA, self._ignore)
        reception.listen(Detection3DArray, "detections", self._on_detections, CAMERA, self._ignore)
        if not any((*bodies.frames, *bodies.topics)):
            self.source = f"detections or poses on {self.resolve_topic_name('poses')}"
            reception.listen(PoseArray, "poses", self._on_poses, CAMERA, self._ignore)

    @property
    def now(self) -> float:
        """The time [s] by the clock of the headers."""
        return float(self.get_clock().now().nanoseconds * 1e-9)

    def _on_push(self, message: Push) -> None:
        ids = message.push_id, message.episode_id, message.scene_id
        self.tracker.sent(*ids, self.now, message.body)

    def _on_result(self, message: PushResult) -> None:
        end = codec.decode_time(message.header.stamp)
        if self.tracker.answered(message.push_id, message.error_code, end):
            self._publish()  # bodies have come to rest already: a look less to wait for

    def _on_detections(self, message: Detection3DArray) -> None:
        seen = decode_detections(message, self.bodies, self.config.frame)
        self._observe(seen, codec.decode_time(message.header.stamp), whole=True)

    def _on_poses(self, message: PoseArray) -> None:
        self._check_frame(message)
        count = len(self.bodies.names)
        if len(message.poses) != count:
            raise InvalidInputError(
                f"{len(message.poses)} poses came; the bodies file has {count} bodies"
            )
        seen = {body: self._observed(body, pose) for body, pose in enumerate(message.poses)}
        self._observe(seen, codec.decode_time(message.header.stamp))

    def _on_pose(self, body: int, message: PoseStamped) -> None:
        self._check_frame(message)
        seen = {body: self._observed(body, message.pose)}
        self._observe(seen, codec.decode_time(message.header.stamp))

    def _observed(self, body: int, pose: Any) -> Observed:
        what = f"the pose of {self.bodies.called(body)}"
        return Observed(wire.decode_pose(pose, what, wire.TIPPED))

    def _check_frame(self, message: PoseArray | PoseStamped) -> None:
        if message.header.frame_id != self.config.frame:
            raise InvalidInputError(
                f"the poses are in frame {message.header.frame_id!r}; they must be in"
                f" {self.config.frame!r}"
            )

    def _on_tf(self, message: TFMessage, static: bool = False) -> None:
        self.tree.take_message(message, static)
        if static:
            return
        framed = [body for body, frame in enumerate(self.bodies.frames) if frame]
        poses = {body: self.tree.pose(self.bodies.frames[body]) for body in framed}
        oldest = min(framed, key=lambda body: poses[body][1])
        if (age := self.now - poses[oldest][1]) > self.config.max_age:
            self._unsettle()
            frame = self.bodies.frames[oldest]
            raise InvalidInputError(
                f"{self.bodies.called(oldest)}, frame {frame!r}, was last seen {age:.1f} s ago"
            )
        seen = {body: Observed(pose) for body, (pose, _) in poses.items()}
        self._observe(seen, min(poses[oldest][1], self.now))

    def _observe(self, seen: dict[int, Observed], stamp: float, whole: bool = False) -> None:
        self.trouble = ""
        if self.tracker.observe(seen, stamp, self.now, whole):
            self._publish()
        self._report()

    def _ignore(self, message: Any, error: BaseException) -> None:
        self.trouble = shortened(str(error))
        self._unsettle()
        self._report()

    def _publish(self) -> None:
        """Publish what was seen, and the shapes at the start of an episode."""
        tracker = self.tracker
        ids = tracker.episode_id, tracker.scene_id
        stamp = codec.encode_time(round(1e9 * tracker.stamp))
        if ids != self.kept:
            self.state.write(episode_id=ids[0], scene_id=ids[1])
            self.kept = ids
        if tracker.began:
            self.shapes_publisher.publish(
                codec.encode_bodies(
                    self.bodies.bodies, self.bodies.radii, stamp=stamp, episode_id=ids[0]
                )
            )
        settled = tracker.settled and not self.conflict
        if not tracker.ready or not self._is_due(ids, settled):
            return
        self.last = codec.encode_scene(
            tracker.scene(), stamp=stamp, episode_id=ids[0], scene_id=ids[1], settled=settled
        )
        self.scene_publisher.publish(self.last)
        things: list[Thing] = [table_top(TABLE), *bodies_in(tracker.scene(), self.bodies.bodies)]
        self.markers.show(markers_of(things, stamp))
        if self.estimates.get_subscription_count():
            known = [
                Sighting(body, pose, covariance, NOTHING)
                for body, (pose, covariance) in enumerate(tracker.estimates())
            ]
            self.estimates.publish(encode_sightings(known, self.bodies, self.config.frame, stamp))

    def _is_due(self, ids: tuple[int, int], settled: bool) -> bool:
        """Return whether to publish a scene: at most at the rate, and each change at once."""
        last = self.last
        if last is None or (last.episode_id, last.scene_id, last.settled) != (*ids, settled):
            return True
        since = self.tracker.stamp - codec.decode_time(last.header.stamp)
        return not 0.0 <= since < 0.9 / self.config.rate

    def _unsettle(self) -> None:
        """Publish the last scene as not settled, so that no push starts from it."""
        if self.last is not None and self.last.settled:
            self.last.settled = False
            self.scene_publisher.publish(self.last)

    def _on_look(self) -> None:
        self.tracker.note_time(self.now)
        if self.tracker.problem or self.tracker.busy_with:
            self._unsettle()
        self._report()

    def _look_around(self) -> None:
        self.conflict = find_second_publisher(self, SINGLE)
        if self.conflict:
            self._unsettle()
        self._report()

    def _unconnected(self) -> str:
        """Return in words that the frame of a body has no place in the world; empty: all have."""
        try:
            for frame in filter(None, self.bodies.frames):
                self.tree.pose(frame)
        except InvalidInputError as error:
            return shortened(str(error))
        return ""

    def _report(self) -> None:
        tracker = self.tracker
        ids = {"episode": tracker.episode_id, "scene": tracker.scene_id}
        problem = self.trouble or (tracker.problem and (self._unconnected() or tracker.problem))
        if self.conflict:
            self.diagnostics.set(ERROR, self.conflict, **ids)
        elif problem or tracker.lost:
            self.diagnostics.set(WARN, problem or tracker.lost, **ids)
        else:
            self.diagnostics.set(OK, "follows the bodies", push=tracker.busy_with, **ids)
