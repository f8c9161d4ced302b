"""A robot's side of the contract of pushes: ids, refusals and results. A robot adds its motion.

Each push gets one result. A push that was begun ends with `finish` when the stroke is over, or with
`refuse` when nothing was moved. Before the tool comes near a body call `check_stroke`. The contract
is docs/guides/your_robot.md.
"""

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic
from typing import Final

import numpy as np
from rclpy.node import Node

from sain_core import wire
from sain_core.errors import BusyError, ErrorCode, error_reply
from sain_core.feasibility import Feasibility, Stroke, checked_stroke
from sain_core.guarding.ros.ownership import find_second_publisher, lock_namespace
from sain_core.guarding.ros.reception import Reception, shortened, take_waiting
from sain_core.guarding.session import Session
from sain_core.ros import codec
from sain_core.ros.node_main import steady_timer
from sain_core.ros.qos import LATCHED_QUEUE, QUEUE, RELIABLE
from sain_core.scene import POSE, RADIUS, THETA, wrap_angle
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray
from sain_core.types import Scene as SceneArray
from sain_core.wire.bodies import decode_bodies
from sain_core.wire.scene_door import OLD, SceneDoor, SeenScene
from sain_interfaces.msg import Bodies as BodiesMessage
from sain_interfaces.msg import Push, PushResult, Scene

AFTER: Final = 0.4  # [s], from the end of a push to the scene that shows what it led to
LONGEST: Final = 45.0  # [s] that bodies may move after a push; the planner waits for 60
PAUSE: Final = 10.0  # [s] between lines of the log that say the same
LOOK: Final = 0.5  # [s] between looks for a second robot, and for bodies that do not come to rest
SEEN: Final = 0.001  # [m], of a body that was moved: far more than rest, less than noise


@dataclass(frozen=True, eq=False)
class PushOrder:
    """A push that is to be carried out: checked, against the scene it was planned from."""

    push: PushArray  # (5,)
    stroke: Stroke  # the tool's way
    scene: SceneArray  # (N, 8), at rest
    bodies: Bodies  # shapes and roles


class PushDriver:
    """Takes pushes for a node, one at a time. Make and call it on the executor's thread."""

    def __init__(
        self,
        node: Node,
        begin: Callable[[PushOrder], None],
        feasibility: Feasibility,
        old: float = OLD,
    ) -> None:
        """Call `begin` with each push that may be carried out; what it raises refuses the push.

        No push is made from a scene that is older than `old` [s].
        """
        self._node, self._begin = node, begin
        self.feasibility = feasibility
        self.release_namespace = lock_namespace(node)  # a second robot ends here
        self._session, self._door = Session(), SceneDoor(old)
        self._before: SeenScene | None = None  # of the push that is under way
        self._after: SeenScene | None = None  # the latest with as many bodies
        self._push, self._began, self._ended = Push(), 0.0, 0.0
        self._doubt: BaseException | None = None  # that the stroke has moved a body
        self.conflict = ""  # with others that answer pushes, in words
        self._late = float("inf")  # when bodies have moved for too long [s], of a steady clock
        self.counts = {"executed": 0, "refused": 0}
        self._results = node.create_publisher(PushResult, "push_result", QUEUE)
        self.reception = Reception(node)
        self._scenes = self.reception.listen(Scene, "scene", self._on_scene, RELIABLE)
        self.reception.listen(BodiesMessage, "shapes", self._on_bodies, LATCHED_QUEUE)
        self.reception.listen(Push, "push", self._on_push, QUEUE, self._refuse)
        steady_timer(node, LOOK, self._look)

    @property
    def busy(self) -> bool:
        """Whether a push is under way."""
        return self._before is not None

    @property
    def waited(self) -> float:
        """How long [s] after a stroke no scene at rest has come; 0: none is waited for."""
        return max(self._now() - self._ended, 0.0) if self.busy else 0.0

    @property
    def scene(self) -> SceneArray | None:
        """The bodies (N, 8) as they were seen last."""
        return None if self._door.seen is None else self._door.seen.disks

    def check_stroke(self) -> None:
        """Raise `StaleSceneError` where bodies are not seen where they were when the push came."""
        take_waiting(self._scenes)
        if self._before is not None:
            self._door.check_stroke(self._before, monotonic(), self._now())

    def finish(self, ended: float, doubt: BaseException | None = None) -> None:
        """Take note that the stroke ended at a time [s], and the tool is away; bodies moved.

        With a `doubt` the push is refused for that if no body is seen to have moved.
        """
        if self.busy:
            self._ended, self._late, self._doubt = ended, monotonic() + LONGEST, doubt

    def refuse(self, error: BaseException) -> None:
        """Refuse the push that is under way: no body was moved, and none will be."""
        if self.busy:
            self._before = None
            self._session.finish(executed=False)
            self._refuse(self._push, error)

    def _now(self) -> float:
        return float(self._node.get_clock().now().nanoseconds * 1e-9)

    def _on_push(self, message: Push) -> None:
        """Begin to push, or raise why not: `Reception` makes the code of the refusal of that."""
        seen, bodies = self._door.seen, self._door.bodies
        if seen is None or bodies is None or self._door.episode_id != seen.ids[0]:
            what = "scene" if seen is None else "shapes of this episode"
            trouble = f": {self._door.trouble}" if self._door.trouble else ""
            raise BusyError(
                f"no {what} came yet{trouble}; does a node make scenes of the camera's poses?"
            )
        if not self._session.busy:
            self._session.go_on_from(*seen.ids)
        self._session.admit(message.push_id, message.episode_id, message.scene_id)
        try:
            self._door.check_push(monotonic(), self._now())
            push, disks = wire.decode_push(message), seen.disks
            if message.disks:
                name = "scene of the push"
                disks = wire.check_bodies(wire.decode_disks(message.disks, name), name)
            stroke = checked_stroke(push, disks, seen.at_rest, self.feasibility, bodies)
            self._push, self._before, self._began = message, seen, self._now()
            self._after, self._doubt = None, None
            self._ended = self._late = float("inf")
            self._begin(PushOrder(push, stroke, seen.disks, bodies))
        except Exception:
            self._before = None
            self._session.finish(executed=False)
            raise

    def _refuse(self, message: Push, error: BaseException) -> None:
        code, text = error_reply(error)
        self.counts["refused"] += 1
        warn_of_refusal(
            self._node,
            code,
            f"push {message.push_id} from {message.source!r} refused: {shortened(text)}",
        )
        scene = Scene() if self._door.seen is None else self._door.seen.message
        self._answer(message, code, shortened(text), scene, scene)

    def _on_bodies(self, message: BodiesMessage) -> None:
        self._door.state_bodies(decode_bodies(message), message.episode_id)

    def _on_scene(self, message: Scene) -> None:
        """Take note of a scene; the first at rest after a push is where that led."""
        seen, before = self._door.take(message, monotonic(), self._now()), self._before
        if before is not None and len(seen.disks) == len(before.disks):
            self._after = seen
            if seen.stamp >= self._ended + AFTER and seen.at_rest:
                self._conclude(seen, settled=True)

    def _look(self) -> None:
        self.conflict = find_second_publisher(self._node, ("push_result",))
        if monotonic() > self._late and (last := self._after or self._before) is not None:
            self._node.get_logger().error(
                f"bodies did not come to rest within {LONGEST:g} s after push {self._push.push_id}"
            )
            self._conclude(last, settled=False)

    def _conclude(self, seen: SeenScene, settled: bool) -> None:
        if (before := self._before) is None:
            return
        self._late = float("inf")
        if self._doubt is not None and settled and _looks_same(before, seen):
            self.refuse(self._doubt)
            return
        self._before = None
        after = Scene(header=seen.message.header, disks=seen.message.disks, settled=settled)
        after.episode_id, after.scene_id = before.ids[0], before.ids[1] + 1
        self._session.finish(executed=True)
        self.counts["executed"] += 1
        self._answer(self._push, ErrorCode.OK, "", before.message, after)

    def _answer(self, push: Push, code: int, text: str, before: Scene, after: Scene) -> None:
        executed = code == ErrorCode.OK
        ended = self._ended if executed else self._now()
        self._results.publish(
            PushResult(
                header=codec.header(codec.encode_time(round(1e9 * ended))),
                push_id=push.push_id,
                episode_id=push.episode_id,
                error_code=int(code),
                error_message=text,
                push=push,
                before=before,
                after=after,
                duration=max(ended - self._began, 0.0) if executed else 0.0,
            )
        )


def warn_of_refusal(node: Node, code: int, text: str) -> None:
    """Log that a push was refused; that a robot is busy, which goes on, only now and then."""
    if code == ErrorCode.BUSY:
        node.get_logger().warning(text, throttle_duration_sec=PAUSE)
    else:
        node.get_logger().warning(text)


def _looks_same(before: SeenScene, after: SeenScene) -> bool:
    """Tell whether no body is seen elsewhere, or turned."""
    off = (after.disks - before.disks)[:, POSE]
    off[:, THETA] = wrap_angle(off[:, THETA]) * before.disks[:, RADIUS]
    return bool(before.ids[0] == after.ids[0] and np.abs(off).max() < SEEN)
