"""A robot's driver: takes pushes, carries them out, and answers each with its result."""

from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion
from rclpy.node import Node

from my_robot.pretend_table import RATE, PretendTable, RobotConfig
from sain_core import wire
from sain_core.errors import BusyError, ErrorCode, error_reply
from sain_core.feasibility import Feasibility, checked_stroke
from sain_core.guarding.ros.ownership import Ownership
from sain_core.guarding.ros.reception import Reception, emptied, shortened
from sain_core.guarding.session import Session
from sain_core.ros import codec
from sain_core.ros.node_main import NAMESPACE, node_main
from sain_core.ros.parameters import read_parameters
from sain_core.ros.qos import QUEUE, RELIABLE, steady_timer
from sain_core.scene import THETA, VELOCITY
from sain_interfaces.msg import Push, PushResult, Scene

AFTER = 0.4  # [s], from the end of a push to the scene that shows what it led to
LOOK_FOR_RIVALS = 0.5  # [s]
ARM = Feasibility()  # where this arm reaches, and its tool


class RobotNode(Node):
    """Carries out one push at a time. The converter makes scenes of its camera's poses."""

    def __init__(self, **options: Any) -> None:
        """Set the table and wait for pushes."""
        super().__init__("robot_node", namespace=NAMESPACE, **options)
        self.table = PretendTable(read_parameters(self, RobotConfig))
        self.ownership = Ownership(self, ("push_result",))  # a second robot ends here
        self.session = Session()
        self.scene: Scene | None = None  # the latest, as the converter sees it
        self.before: Scene | None = None  # of the push that is under way
        self.push, self.began, self.ended = Push(), 0.0, 0.0
        self.results = self.create_publisher(PushResult, "push_result", QUEUE)
        self.poses = self.create_publisher(PoseArray, "poses", RELIABLE)
        self.truth = self.create_publisher(PoseArray, "true_poses", RELIABLE)  # for who judges
        self.reception = Reception(self)
        self.reception.listen(Scene, "scene", self._on_scene, RELIABLE)
        self.reception.listen(Push, "push", self._on_push, QUEUE, self._refuse)
        self.reception.listen(PoseArray, "set_up", self._on_set_up, RELIABLE)
        steady_timer(self, 1.0 / RATE, self._on_frame)
        steady_timer(self, LOOK_FOR_RIVALS, self.ownership.rival)
        self.ready = f"{len(self.table.bodies)} bodies on the table"

    @property
    def now(self) -> float:
        """The time [s]."""
        return float(self.get_clock().now().nanoseconds * 1e-9)

    def _on_push(self, message: Push) -> None:
        """Begin to push, or raise why not: `Reception` makes the code of the refusal of that."""
        scene = self.scene
        if scene is None:
            raise BusyError("no scene has come yet; is scene_node running?")
        if not self.session.busy:
            self.session.go_on_from(scene.episode_id, scene.scene_id)
        self.session.admit(message.push_id, message.episode_id, message.scene_id)
        try:
            push = wire.decode_push(message)
            disks = wire.decode_disks(message.disks or scene.disks)
            checked_stroke(push, disks, is_at_rest(scene), ARM, self.table.bodies)
        except Exception:
            self.session.finish(executed=False)
            raise
        self.push, self.before, self.began = message, scene, self.now
        self.ended = self.table.push(push, self.began)  # here a real robot moves

    def _refuse(self, message: Push, error: BaseException) -> None:
        code, text = error_reply(error)
        scene = self.scene or Scene()
        self._answer(emptied(message), code, shortened(text), scene, scene)

    def _on_frame(self) -> None:
        """Do what the camera does: publish where the bodies are."""
        now = self.now
        seen, stamp = self.table.look(now), codec.encode_time(round(1e9 * now))
        self.poses.publish(encode_poses(seen, stamp))
        self.truth.publish(encode_poses(self.table.scene[:, : THETA + 1], stamp))

    def _on_scene(self, message: Scene) -> None:
        """Take note of a scene; the first at rest after a push is where that led."""
        self.scene = message
        seen = codec.decode_time(message.header.stamp)
        if self.before is None or seen < self.ended + AFTER or not is_at_rest(message):
            return
        before, self.before = self.before, None
        after = Scene(header=message.header, disks=message.disks, settled=True)
        after.episode_id, after.scene_id = before.episode_id, before.scene_id + 1
        self.session.finish(executed=True)
        self._answer(self.push, ErrorCode.OK, "", before, after)

    def _answer(self, push: Push, code: int, text: str, before: Scene, after: Scene) -> None:
        ended = self.ended if code == ErrorCode.OK else self.now
        self.results.publish(
            PushResult(
                header=codec.header(codec.encode_time(round(1e9 * ended))),
                push_id=push.push_id,
                episode_id=push.episode_id,
                error_code=int(code),
                error_message=text,
                push=push,
                before=before,
                after=after,
                duration=max(ended - self.began, 0.0) if code == ErrorCode.OK else 0.0,
            )
        )

    def _on_set_up(self, message: PoseArray) -> None:
        """Let a person put the bodies elsewhere; their push, if there is one, comes to nothing."""
        rows = [
            (p.position.x, p.position.y, 2 * np.arctan2(p.orientation.z, p.orientation.w))
            for p in message.poses
        ]
        self.table.set_up(np.array(rows))

    def destroy_node(self) -> None:
        """Let another driver have the results."""
        super().destroy_node()
        self.ownership.release()


def is_at_rest(scene: Scene) -> bool:
    """Tell whether the converter sees all bodies at rest: none has a velocity then."""
    return not wire.decode_disks(scene.disks)[:, VELOCITY].any()


def encode_poses(poses: np.ndarray, stamp: Time) -> PoseArray:
    """Return poses (N, 3) as a message."""
    message = PoseArray(header=codec.header(stamp))
    for x, y, theta in poses.tolist():
        turn = Quaternion(z=float(np.sin(theta / 2)), w=float(np.cos(theta / 2)))
        message.poses.append(Pose(position=Point(x=x, y=y), orientation=turn))
    return message


def main() -> None:
    """Run the node."""
    node_main(RobotNode, "robot_node")


if __name__ == "__main__":
    main()
