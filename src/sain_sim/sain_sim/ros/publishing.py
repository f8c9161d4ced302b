"""The simulator's topics: encodes and publishes its messages."""

from concurrent.futures import Future
from math import cos, sin
from typing import Final

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from sain_arm.robot.arm_model import ArmModel
from sain_arm.robot.urdf import visible
from sain_core.camera.image_camera import Shot
from sain_core.errors import SainError
from sain_core.guarding.ros.reception import shortened
from sain_core.ros import codec
from sain_core.ros.camera_topics import CameraTopics
from sain_core.ros.markers import MarkerBoard, markers_of, tool_marker
from sain_core.ros.node_main import ERROR, NAMESPACE, OK, WARN, Diagnostics
from sain_core.ros.push_driver import PushDriver
from sain_core.ros.qos import LATCHED, RELIABLE, TRANSFORMS
from sain_core.ros.worker import Worker
from sain_core.scene import DISK_HEIGHT, THETA, X, Y, is_settled
from sain_core.types import Scene
from sain_core.view.scenes import bodies_in, table_top
from sain_core.view.things import Thing
from sain_interfaces.msg import Bodies, WorldParameters
from sain_interfaces.msg import Scene as SceneMessage
from sain_interfaces.srv import ResetScene
from sain_sim.ros.simulator import Simulator
from sain_sim.world.workcell import Sample, WorldConfig

BODY_FRAME: Final = "body_{}"


class Transforms:
    """Publishes where links and bodies are, each frame once a moment: tf2 drops repeated data."""

    def __init__(self, node: Node, config: WorldConfig, frame_prefix: str) -> None:
        """Describe the arm, to whoever joins."""
        self._prefix = frame_prefix
        self._arm = ArmModel(config.arm)
        self._description = visible(config.arm.description)
        self._said = node.create_publisher(String, "robot_description", LATCHED)
        self._static = node.create_publisher(TFMessage, "/tf_static", LATCHED)
        self._moving = node.create_publisher(TFMessage, "/tf", TRANSFORMS)
        self._last: tuple[bytes, bytes, int] | None = None  # poses, and how many listen
        self._stamp_ns = -1

    def describe(self, stamp: Time, camera: TransformStamped) -> None:
        """Publish the arm's description, and the frame of a camera, which never moves."""
        self._said.publish(String(data=self._description))
        self._static.publish(TFMessage(transforms=[camera]))

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
        moving = []
        for name, (place, turn) in self._arm.frames(sample.joint_positions).items():
            (x, y, z), (w, a, b, c) = place.tolist(), turn.tolist()
            spot = Vector3(x=x, y=y, z=z)
            moving.append(self._transform(name, spot, Quaternion(x=a, y=b, z=c, w=w), stamp))
        for body, (x, y, theta) in enumerate(poses.tolist()):
            spot = Vector3(x=x, y=y, z=DISK_HEIGHT / 2)
            turned = Quaternion(z=sin(theta / 2), w=cos(theta / 2))
            moving.append(self._transform(BODY_FRAME.format(body), spot, turned, stamp))
        self._moving.publish(TFMessage(transforms=moving))

    def _transform(
        self, frame: str, place: Vector3, turn: Quaternion, stamp: Time
    ) -> TransformStamped:
        """Return a frame's pose in the world."""
        made = TransformStamped(header=codec.header(stamp), child_frame_id=self._prefix + frame)
        made.header.frame_id = codec.WORLD_FRAME
        made.transform.translation, made.transform.rotation = place, turn
        return made


def frame_prefix(node: Node, given: str) -> str:
    """Return what the frames of a node begin with: as given, or its namespace if that is unusual.

    So two graphs can share ``/tf``.
    """
    namespace = node.get_namespace().strip("/")
    return given or ("" if namespace in ("", NAMESPACE) else f"{namespace}/")


class Publishing:
    """The simulator's topics.

    Attributes:
        sample: the world as it is between two pushes.
        settled: its scene, which the next push must name.
    """

    def __init__(self, node: Node, simulator: Simulator, driver: PushDriver) -> None:
        """Create the publishers."""
        self._node, self._simulator = node, simulator
        self._driver, self._session = driver, driver.session
        self._clock = node.create_publisher(Clock, "/clock", RELIABLE)
        # Before the scene's: a planner that sees scenes can see that there are shapes to wait for.
        self._shapes = (
            node.create_publisher(Bodies, "shapes", LATCHED) if simulator.config.scenes else None
        )
        self._scene = None
        if simulator.config.scenes:
            self._scene = node.create_publisher(SceneMessage, "scene", RELIABLE)
        self._joints = node.create_publisher(JointState, "joint_states", RELIABLE)
        self._markers = MarkerBoard(node, "markers")
        self._world = node.create_publisher(WorldParameters, "world_parameters", LATCHED)
        config = simulator.config
        prefix = frame_prefix(node, config.frame_prefix)
        self._transforms = Transforms(node, config.cell, prefix)
        self.images = CameraTopics(node, config.images, prefix)
        self._transforms.describe(self.now(), self.images.transform(self.now()))
        self._next_shot = 0.0  # [s], simulated
        self._diagnostics = Diagnostics(
            node, "simulation", now=self.now, more=lambda: driver.reception.figures
        )

    def now(self) -> Time:
        """Return the simulated time."""
        return codec.encode_time(self._simulator.pacer.now_ns)

    def take(self, sample: Sample) -> None:
        """Take the world as it is for the settled one, which the next push must name."""
        self.sample = sample
        self.settled = self.scene_message()
        self._driver.set_scene(self.settled, self._simulator.parameters.bodies)

    def settle(self) -> None:
        """Publish a settled world that is new."""
        if self._simulator.camera_timer is not None:
            self._simulator.camera_timer.renew()
        self.state()

    def state(self) -> None:
        """Publish the settled world."""
        self._state(self.sample, self.settled)

    def moving(self, sample: Sample) -> None:
        """Publish a world that moves, and what its camera sees."""
        self._state(sample, self._encode(sample.scene, self.now(), settled=False))
        if (timer := self._simulator.camera_timer) is not None:
            timer.observe_moving(sample)
            self._frames(settled=False)
        now = self._simulator.pacer.now
        if self.images.wanted and now >= self._next_shot:
            self._shot(self._simulator.shoot(sample), self.now())

    def look(self, worker: Worker) -> None:
        """Take images of bodies at rest, if somebody wants any; time goes on."""
        if worker.pending or not self.images.wanted:
            return
        simulator, sample = self._simulator, self.sample
        if simulator.config.real_time_factor > 0.0:
            simulator.pacer.idle()
        else:
            simulator.pacer.skip(1.0 / simulator.config.images.rate)
        self.tick()
        stamp = self.now()

        def publish(done: "Future[Shot]") -> None:
            if isinstance(error := done.exception(), SainError):
                text = f"no images: {shortened(str(error))}"
                self._node.get_logger().error(text, throttle_duration_sec=10.0)
            else:
                self._shot(done.result(), stamp)

        worker.submit(lambda: simulator.shoot(sample), publish)

    def _shot(self, shot: Shot, stamp: Time) -> None:
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

    def scene_message(self) -> SceneMessage:
        """Return the scene of the world that rests, with time and ids of this moment."""
        scene = self.sample.scene
        return self._encode(scene, self.now(), bool(is_settled(scene)))

    def _encode(self, scene: Scene, stamp: Time, settled: bool) -> SceneMessage:
        ids = {"episode_id": self._session.episode_id, "scene_id": self._session.scene_id}
        return codec.encode_scene(scene, stamp=stamp, settled=settled, **ids)

    def _state(self, sample: Sample, scene: SceneMessage) -> None:
        """Publish time, joints, frames and markers, and the scene unless a camera sees it."""
        self.tick()
        stamp = scene.header.stamp
        joints = JointState(
            header=codec.header(stamp), name=list(self._simulator.config.cell.arm.joints)
        )
        joints.position = codec.encode_floats(sample.joint_positions)
        joints.velocity = codec.encode_floats(sample.joint_velocities)
        self._joints.publish(joints)
        self._transforms.publish(sample, self._simulator.pacer.now_ns)
        table = self._simulator.config.cell.feasibility.table
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
                header=codec.header(self.now()),
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

    def report(self) -> None:
        """Report the state of the simulator, a conflict first."""
        session, config = self._session, self._simulator.config
        figures = {
            "engine": config.engine,
            "bottom": self._simulator.parameters.bottom,
            "episode": session.episode_id,
            "scene": session.scene_id,
            **self._driver.counts,
        }
        if conflict := self._driver.conflict:
            self._diagnostics.set(ERROR, conflict, **figures)
        elif not session.busy and not self.settled.settled:
            message = "the disks do not come to rest; reset the scene"
            self._diagnostics.set(WARN, message, **figures)
        else:
            self._diagnostics.set(OK, "simulating", **figures)
