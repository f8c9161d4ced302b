"""The simulator's topics: encodes and publishes its messages."""

from math import cos, sin
from typing import Final

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String
from tf2_msgs.msg import TFMessage

from sain_core.camera.image_camera import Shot
from sain_core.errors import ErrorCode, SainError, error_reply
from sain_core.guarding.ros.reception import Reception, shortened
from sain_core.guarding.session import Session
from sain_core.ros import codec
from sain_core.ros.camera_topics import CameraTopics
from sain_core.ros.markers import MarkerBoard, markers_of, tool_marker
from sain_core.ros.node_main import ERROR, NAMESPACE, OK, WARN, Diagnostics
from sain_core.ros.qos import LATCHED, QUEUE, RELIABLE, TRANSFORMS
from sain_core.scene import DISK_HEIGHT, THETA, X, Y, is_settled
from sain_core.types import Scene
from sain_core.view.scenes import bodies_in, table_top
from sain_core.view.things import Thing
from sain_interfaces.msg import Bodies, Prediction, Push, PushResult, WorldParameters
from sain_interfaces.msg import Scene as SceneMessage
from sain_interfaces.srv import ResetScene
from sain_sim.arm.panda import BASE_FRAME, JOINT_NAMES, Link, describe_arm, links_of
from sain_sim.ros.simulator import SHADOW_MODEL, Pushed, Simulator
from sain_sim.world.workcell import Sample, WorldConfig

BODY_FRAME: Final = "body_{}"


class Transforms:
    """Publishes where links and bodies are, each frame once a moment: tf2 drops repeated data."""

    def __init__(self, node: Node, config: WorldConfig, frame_prefix: str) -> None:
        """Describe the arm and its fixed frames, to whoever joins."""
        limits, kinematics = config.feasibility.limits, config.kinematics
        self._prefix = frame_prefix
        self._description = describe_arm(limits.tool_radius)
        links = links_of(self._description)
        self._links = [link for link in links if link.moves]
        self._fixed = [link for link in links if not link.moves]
        self._base_height = kinematics.base_height
        self._said = node.create_publisher(String, "robot_description", LATCHED)
        self._static = node.create_publisher(TFMessage, "/tf_static", LATCHED)
        self._moving = node.create_publisher(TFMessage, "/tf", TRANSFORMS)
        self._last: tuple[bytes, bytes, int] | None = None  # poses, and how many listen
        self._stamp_ns = -1

    def describe(self, stamp: Time, camera: TransformStamped) -> None:
        """Publish the arm's description, and the frames that never move, with a camera's."""
        self._said.publish(String(data=self._description))
        base = Vector3(z=self._base_height)
        fixed = [self._transform(codec.WORLD_FRAME, self._prefix + BASE_FRAME, base, stamp)]
        fixed += [self._link(link, 0.0, stamp) for link in self._fixed]
        fixed.append(camera)  # in one message: late subscribers with a short queue hear only one
        self._static.publish(TFMessage(transforms=fixed))

    def publish(self, sample: Sample, now_ns: int) -> None:
        """Publish where links and bodies are at a time [ns]; nothing where that is known."""
        listeners = self._moving.get_subscription_count()
        poses = sample.scene[:, [X, Y, THETA]]
        state = sample.joint_positions.tobytes(), poses.tobytes(), listeners
        if state == self._last and now_ns <= self._stamp_ns:
            return
        # Time may stand still between two scenes, and tf2 takes one pose of a frame at a time.
        self._last, self._stamp_ns = state, max(now_ns, self._stamp_ns + 1)
        stamp = codec.encode_time(self._stamp_ns)
        angles = sample.joint_positions.tolist()
        moving = [
            self._link(link, angle, stamp) for link, angle in zip(self._links, angles, strict=True)
        ]
        for body, (x, y, theta) in enumerate(poses.tolist()):
            frame = self._prefix + BODY_FRAME.format(body)
            place = Vector3(x=x, y=y, z=DISK_HEIGHT / 2)
            turn = Quaternion(z=sin(theta / 2), w=cos(theta / 2))
            moving.append(self._transform(codec.WORLD_FRAME, frame, place, stamp, turn))
        self._moving.publish(TFMessage(transforms=moving))

    def _link(self, link: Link, angle: float, stamp: Time) -> TransformStamped:
        (x, y, z), (a, b, c, d) = link.origin, link.turned(angle)
        place, turn = Vector3(x=x, y=y, z=z), Quaternion(x=a, y=b, z=c, w=d)
        parent, child = self._prefix + link.parent, self._prefix + link.child
        return self._transform(parent, child, place, stamp, turn)

    @staticmethod
    def _transform(
        parent: str, child: str, place: Vector3, stamp: Time, turn: Quaternion | None = None
    ) -> TransformStamped:
        made = TransformStamped(header=codec.header(stamp), child_frame_id=child)
        made.header.frame_id = parent
        made.transform.translation = place
        made.transform.rotation = turn or Quaternion(w=1.0)
        return made


def frame_prefix(node: Node, given: str) -> str:
    """Return what the frames of a node begin with: as given, or its namespace if that is unusual.

    So two graphs can share ``/tf``.
    """
    namespace = node.get_namespace().strip("/")
    return given or ("" if namespace in ("", NAMESPACE) else f"{namespace}/")


class Publishing:
    """The simulator's topics."""

    def __init__(
        self, node: Node, simulator: Simulator, session: Session, reception: Reception
    ) -> None:
        """Create the publishers."""
        self._simulator = simulator
        self._session = session
        self._clock = node.create_publisher(Clock, "/clock", RELIABLE)
        # Before the scene's: a planner that sees scenes can see that there are shapes to wait for.
        self._shapes = (
            node.create_publisher(Bodies, "shapes", LATCHED) if simulator.config.scenes else None
        )
        self._scene = None
        if simulator.config.scenes:
            self._scene = node.create_publisher(SceneMessage, "scene", RELIABLE)
        self._result = node.create_publisher(PushResult, "push_result", QUEUE)
        self._joints = node.create_publisher(JointState, "joint_states", RELIABLE)
        self._markers = MarkerBoard(node, "markers")
        self._world = node.create_publisher(WorldParameters, "world_parameters", LATCHED)
        config = simulator.config
        prefix = frame_prefix(node, config.frame_prefix)
        self._transforms = Transforms(node, config.bullet, prefix)
        self.images = CameraTopics(node, config.images, prefix)
        self._transforms.describe(self.now(), self.images.transform(self.now()))
        self._next_shot = 0.0  # [s], simulated
        self._diagnostics = Diagnostics(
            node, "simulation", now=self.now, more=lambda: reception.figures
        )

    def now(self) -> Time:
        """Return the simulated time."""
        return codec.encode_time(self._simulator.pacer.now_ns)

    def take(self, sample: Sample) -> None:
        """Take the world as it is for the settled one, which the next push must name."""
        self.sample = sample
        self.settled = self._scene_message(sample, settled=bool(is_settled(sample.scene)))

    def settle(self, sample: Sample) -> None:
        """Publish a new settled world."""
        if self._simulator.camera_timer is not None:
            self._simulator.camera_timer.renew()
        self.take(sample)
        self.state()

    def state(self) -> None:
        """Publish the settled world."""
        self._state(self.sample, self.settled)

    def moving(self, sample: Sample) -> None:
        """Publish a world that moves, and what its camera sees."""
        self._state(sample, self._scene_message(sample, settled=False))
        if (timer := self._simulator.camera_timer) is not None:
            timer.observe_moving(sample)
            self._frames(settled=False)
        now = self._simulator.pacer.now
        if self.images.wanted and now >= self._next_shot:
            self.shot(self._simulator.shoot(sample), self.now())

    def shot(self, shot: Shot, stamp: Time) -> None:
        """Publish images that were taken at a time."""
        self._next_shot = self._simulator.pacer.now + 1.0 / self._simulator.config.images.rate
        self.images.publish(shot, stamp)

    def tick(self) -> None:
        """Publish the simulated time."""
        self._clock.publish(Clock(clock=self.now()))

    def frame(self) -> None:
        """Publish what the camera sees of the settled world, if it is time for a frame."""
        timer = self._simulator.camera_timer
        if timer is not None and timer.observe(self.sample):
            self._frames(settled=True)

    def _scene_message(self, sample: Sample, settled: bool) -> SceneMessage:
        """Return the scene with the ids of this moment."""
        return self._encode(sample.scene, self.now(), settled)

    def _encode(self, scene: Scene, stamp: Time, settled: bool) -> SceneMessage:
        ids = {"episode_id": self._session.episode_id, "scene_id": self._session.scene_id}
        return codec.encode_scene(scene, stamp=stamp, settled=settled, **ids)

    def _state(self, sample: Sample, scene: SceneMessage) -> None:
        """Publish time, joints, frames and markers, and the scene unless a camera sees it."""
        self.tick()
        stamp = scene.header.stamp
        joints = JointState(header=codec.header(stamp), name=list(JOINT_NAMES))
        joints.position = codec.encode_floats(sample.joint_positions)
        joints.velocity = codec.encode_floats(sample.joint_velocities)
        self._joints.publish(joints)
        self._transforms.publish(sample, self._simulator.pacer.now_ns)
        table = self._simulator.config.bullet.feasibility.table
        bodies = self._simulator.parameters.bodies
        things: list[Thing] = [table_top(table), *bodies_in(sample.scene, bodies)]
        tool = tool_marker(sample.tool.tolist(), stamp)
        self._markers.show([*markers_of(things, stamp), tool])
        if self._simulator.camera is None and self._scene is not None:
            self._scene.publish(scene)

    def _frames(self, settled: bool) -> None:
        """Publish what has arrived from the camera by now, and the time."""
        self.tick()
        camera, now = self._simulator.camera, self._simulator.pacer.now
        for frame in () if camera is None else camera.arrived(now):
            stamp = codec.encode_time(round(1e9 * frame.time))
            if self._scene is not None:
                self._scene.publish(self._encode(frame.scene, stamp, settled))

    def episode(self, begun: ResetScene.Request) -> None:
        """Publish shape and role of each body of an episode, and the parameters of its world."""
        simulator, episode_id = self._simulator, self._session.episode_id
        parameters, radii = simulator.parameters, simulator.radii
        ids = {"stamp": self.now(), "episode_id": episode_id}
        if self._shapes is not None:
            self._shapes.publish(codec.encode_bodies(parameters.bodies, radii, **ids))
        self._world.publish(
            WorldParameters(
                header=self._header(),
                episode_id=episode_id,
                seed=begun.seed,
                world=(begun.world or simulator.config.world) + simulator.within,
                shapes=list(parameters.shapes),
                roles=list(parameters.roles),
                bottom=parameters.bottom,
                friction=parameters.friction,
                rim_friction=parameters.rim_friction,
                tool_friction=parameters.tool_friction,
            )
        )

    def executed(self, push: Push, pushed: Pushed) -> PushResult:
        """Return the result of an executed push, and take the world after it."""
        message = self._reply(push, ErrorCode.OK, "")
        message.before = self.settled
        self.take(pushed.sample)
        message.after = self.settled
        message.duration = pushed.outcome.duration
        message.wall_time = pushed.wall_time
        message.prediction = _prediction(pushed.predicted)
        return message

    def result(self, message: PushResult) -> None:
        """Publish the result of a push."""
        self._result.publish(message)

    def refusal(self, push: Push, error: BaseException) -> None:
        """Publish why a push was refused; the scene is unchanged."""
        code, text = error_reply(error)
        message = self._reply(push, code, shortened(text))
        message.before = message.after = self.settled
        self._result.publish(message)

    def _reply(self, push: Push, code: int, text: str) -> PushResult:
        return PushResult(
            header=self._header(),
            push_id=push.push_id,
            episode_id=push.episode_id,
            error_code=int(code),
            error_message=text,
            push=push,
        )

    def report(self, conflict: str, counts: dict[str, int]) -> None:
        """Report the state of the simulator, a conflict first, and so many pushes of each kind."""
        session, config = self._session, self._simulator.config
        ids = {"episode": session.episode_id, "scene": session.scene_id}
        figures = {
            "engine": config.engine,
            "bottom": self._simulator.parameters.bottom,
            **ids,
            **counts,
        }
        if conflict:
            self._diagnostics.set(ERROR, conflict, **figures)
        elif not session.busy and not self.settled.settled:
            message = "the disks do not come to rest; reset the scene"
            self._diagnostics.set(WARN, message, **figures)
        else:
            self._diagnostics.set(OK, "simulating", **figures)

    def _header(self) -> Header:
        return codec.header(self.now())


def _prediction(predicted: Scene | SainError | None) -> Prediction:
    """Return the shadow world's prediction of a push, or its error; empty for None."""
    if predicted is None:
        return Prediction()
    message = Prediction(model=SHADOW_MODEL, error_code=int(ErrorCode.OK))
    if isinstance(predicted, SainError):
        message.error_code, message.error_message = error_reply(predicted)
    else:
        message.disks = codec.encode_disks(predicted)
    return message
