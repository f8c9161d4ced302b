"""``/tf``, ``/tf_static`` and ``robot_description``: arm and bodies as RViz draws them."""

from math import cos, sin
from typing import Final

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from rclpy.node import Node
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from sain_core.ros import codec
from sain_core.ros.node_main import NAMESPACE
from sain_core.ros.qos import LATCHED, TRANSFORMS
from sain_core.scene import DISK_HEIGHT, THETA, X, Y
from sain_sim.arm.panda import BASE_FRAME, Link, describe_arm, links_of
from sain_sim.world.workcell import Sample, WorldConfig

BODY_FRAME: Final = "body_{}"


class Transforms:
    """Publishes where links and bodies are, each frame once a moment: tf2 drops repeated data."""

    def __init__(self, node: Node, config: WorldConfig, frame_prefix: str) -> None:
        """Describe the arm and its fixed frames, to whoever joins."""
        limits, kinematics = config.feasibility.limits, config.kinematics
        self._prefix = frame_prefix
        self._description = describe_arm(limits.tool_radius, kinematics.tool_length)
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
