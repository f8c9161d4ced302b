"""The simulator's topics: encodes and publishes its messages."""

from math import cos, sin
from typing import Final

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from sain_arm.robot.arm_model import ArmModel
from sain_arm.robot.robot import Robot
from sain_arm.robot.urdf import visible
from sain_core.ros import codec
from sain_core.ros.camera_topics import CameraTopics, make_transform
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
from sain_sim.world.workcell import Sample

BODY_FRAME: Final = "body_{}"


class Transforms:
    """Publishes where links and bodies are, each frame once a moment: tf2 drops repeated data."""

    def __init__(self, node: Node, arm: Robot, prefix: str, camera: TransformStamped) -> None:
        """Describe the arm, and where a camera is, which never moves, to whoever joins."""
        self._prefix, self._arm = prefix, ArmModel(arm)
        description = String(data=visible(arm.description))
        node.create_publisher(String, "robot_description", LATCHED).publish(description)
        static = node.create_publisher(TFMessage, "/tf_static", LATCHED)
        static.publish(TFMessage(transforms=[camera]))
        self._moving = node.create_publisher(TFMessage, "/tf", TRANSFORMS)
        self._last: tuple[bytes, bytes, int] | None = None  # poses, and how many listen
        self._stamp_ns = -1

    def publish(self, sample: Sample, now_ns: int) -> None:
        """Publish where links and bodies are at a time [ns]; nothing where that is known."""
        listeners = self._moving.get_subscription_count()
        poses = sample.scene[:, [X, Y, THETA]]
        state = sample.joint_positions.tobytes(), poses.tobytes(), listeners
        if state == self._last and now_ns <= self._stamp_ns:
            return
        # Time may stand still between two scenes, and tf2 takes one pose of a frame at a time.
        self._last, self._stamp_ns = state, max(now_ns, self._stamp_ns + 1)
        frames = self._arm.frames(sample.joint_positions)
        for body, (x, y, theta) in enumerate(poses.tolist()):
            turn = np.array([cos(theta / 2), 0.0, 0.0, sin(theta / 2)])
            frames[BODY_FRAME.format(body)] = np.array([x, y, DISK_HEIGHT / 2]), turn
        header = codec.header(codec.encode_time(self._stamp_ns))
        moving = [
            make_transform(header, self._prefix + name, place, np.roll(turn, -1))
            for name, (place, turn) in frames.items()
        ]
        self._moving.publish(TFMessage(transforms=moving))


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
        self.node, self.simulator, self.driver = node, simulator, driver
        self._session, config, make = driver.session, simulator.config, node.create_publisher
        self._clock = make(Clock, "/clock", RELIABLE)
        # Before the scene's: a planner that sees scenes can see that there are shapes to wait for.
        self._shapes = make(Bodies, "shapes", LATCHED) if config.scenes else None
        self._scene = make(SceneMessage, "scene", RELIABLE) if config.scenes else None
        self._joints = make(JointState, "joint_states", RELIABLE)
        self._markers = MarkerBoard(node, "markers")
        self._world = make(WorldParameters, "world_parameters", LATCHED)
        prefix = frame_prefix(node, config.frame_prefix)
        self.images = CameraTopics(node, config.images, prefix)
        camera = self.images.transform(self.now())
        self._transforms = Transforms(node, config.cell.arm, prefix, camera)
        self._next_shot = 0.0  # [s], simulated
        self._stated = 0  # episode whose world was published; 0: none
        self._begun = ResetScene.Request()
        self._diagnostics = Diagnostics(
            node, "simulation", now=self.now, more=lambda: driver.reception.figures
        )

    def now(self) -> Time:
        """Return the simulated time."""
        return codec.encode_time(self.simulator.pacer.now_ns)

    def take(self, sample: Sample) -> None:
        """Take the world as it is for the settled one, which the next push must name."""
        self.sample = sample
        self.settled = self.scene_message()
        self.driver.set_scene(self.settled, self.simulator.parameters.bodies)

    def settle(self) -> None:
        """Publish a settled world that is new."""
        if self.simulator.camera_timer is not None:
            self.simulator.camera_timer.renew()
        self.state()

    def state(self) -> None:
        """Publish the settled world."""
        self._state(self.sample, self.settled)

    def moving(self, sample: Sample) -> None:
        """Publish a world that moves, and what its camera sees."""
        self._state(sample, self._encode(sample.scene, self.now(), settled=False))
        if (timer := self.simulator.camera_timer) is not None:
            timer.observe_moving(sample)
            self._frames(settled=False)
        now = self.simulator.pacer.now
        if self.images.wanted and now >= self._next_shot:
            self._time_shot()
            self.images.publish(self.simulator.shoot(sample), self.now())

    def look(self, worker: Worker) -> None:
        """Take images of bodies at rest, if somebody wants any; time goes on."""
        if worker.pending or not self.images.wanted:
            return
        simulator, sample = self.simulator, self.sample
        if simulator.config.real_time_factor > 0.0:
            simulator.pacer.idle()
        else:
            simulator.pacer.skip(1.0 / simulator.config.images.rate)
        self.tick()
        self._time_shot()
        self.images.take(worker, lambda: simulator.shoot(sample), self.now())

    def _time_shot(self) -> None:
        self._next_shot = self.simulator.pacer.now + 1.0 / self.simulator.config.images.rate

    def tick(self) -> None:
        """Publish the simulated time."""
        self._clock.publish(Clock(clock=self.now()))

    def frame(self) -> None:
        """Publish what the camera sees of the settled world, if it is time for a frame."""
        timer = None if self._session.busy else self.simulator.camera_timer
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
        cell = self.simulator.config.cell
        joints = JointState(header=codec.header(stamp), name=list(cell.arm.joints))
        joints.position = codec.encode_floats(sample.joint_positions)
        joints.velocity = codec.encode_floats(sample.joint_velocities)
        self._joints.publish(joints)
        self._transforms.publish(sample, self.simulator.pacer.now_ns)
        bodies = bodies_in(sample.scene, self.simulator.parameters.bodies)
        things: list[Thing] = [table_top(cell.feasibility.table), *bodies]
        tool = tool_marker(sample.tool.tolist(), stamp)
        self._markers.show([*markers_of(things, stamp), tool])
        if self.simulator.camera is None and self._scene is not None:
            self._scene.publish(scene)

    def _frames(self, settled: bool) -> None:
        """Publish what has arrived from the camera by now, and the time."""
        self.tick()
        camera, now = self.simulator.camera, self.simulator.pacer.now
        for frame in () if camera is None else camera.arrived(now):
            stamp = codec.encode_time(round(1e9 * frame.time))
            if self._scene is not None:
                self._scene.publish(self._encode(frame.scene, stamp, settled))

    def episode(self, begun: ResetScene.Request) -> None:
        """Publish shape and role of each body of an episode, and the parameters of its world.

        Where somebody else makes the scenes, it is not known yet which episode that will be.
        """
        simulator, self._begun, self._stated = self.simulator, begun, 0
        ids = {"stamp": self.now(), "episode_id": self._session.episode_id}
        if self._shapes is not None:
            bodies = simulator.parameters.bodies
            self._shapes.publish(codec.encode_bodies(bodies, simulator.radii, **ids))
            self.state_world()

    def state_world(self) -> None:
        """Publish the parameters of the world, unless they were since it began."""
        simulator, episode_id, begun = self.simulator, self._session.episode_id, self._begun
        if self._stated == episode_id:
            return
        self._stated, parameters = episode_id, simulator.parameters
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
        session, simulator = self._session, self.simulator
        figures: dict[str, object] = {"engine": simulator.config.engine, **self.driver.counts}
        figures |= {"bottom": simulator.parameters.bottom}
        figures |= {"episode": session.episode_id, "scene": session.scene_id}
        if conflict := self.driver.conflict:
            self._diagnostics.set(ERROR, conflict, **figures)
        elif not session.busy and not self.settled.settled:
            message = "the disks do not come to rest; reset the scene"
            self._diagnostics.set(WARN, message, **figures)
        else:
            self._diagnostics.set(OK, "simulating", **figures)
