"""A robot's side of the contract of pushes: ids, refusals and results. A robot adds its motion.

Each push gets one result. A push that was begun ends with `finish` when the stroke is over, or with
`refuse` when nothing was moved. Before the tool comes near a body call `check_stroke`. The contract
is docs/guides/your_robot.md.
"""

from collections.abc import Callable
from math import inf
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
from sain_core.types import Scene as SceneArray
from sain_core.wire.bodies import decode_bodies
from sain_core.wire.scene_door import OLD, SceneDoor, SeenScene
from sain_interfaces.msg import Bodies as BodiesMessage
from sain_interfaces.msg import Push, PushResult, Scene

MARGIN: Final = 0.03  # [s], from the end of a stroke to a scene in which bodies are after it
AFTER: Final = 0.2  # [s], from the end of a push to the scene that shows what it led to
LONGEST_UNSEEN: Final = 20.0  # [s] after a stroke, in which an arm makes room for a camera
LONGEST: Final = 45.0  # [s] that bodies may move after a push; the planner waits for 60
PAUSE: Final = 10.0  # [s] between lines of the log that say the same
LOOK: Final = 0.5  # [s] between looks for a second robot, and for bodies that do not come to rest
MAKER: Final = "does a node make scenes of the camera's poses?"
Begin = Callable[[Push, Stroke], None]
SEEN: Final = 0.001  # [m], of a body that was moved: far more than rest, less than noise


class PushDriver:
    """Takes pushes for a node, one at a time. Make and call it on the executor's thread.

    A robot that sees its bodies by itself gives the scenes by `set_scene`, and ends each push that
    was carried out by `conclude`. For others scenes and shapes are subscribed.

    Attributes:
        now: returns the time of headers [s], by default of the node's clock.
        answer: publishes a result.
        owned: topics that nobody else may publish.
        conflict: who publishes one of them, too, in words.
    """

    def __init__(
        self,
        node: Node,
        begin: Begin,
        feasibility: Feasibility,
        old: float = OLD,
        sees: bool = False,
    ) -> None:
        """Call `begin` with each push that may be carried out; what it raises refuses the push.

        No push is made from a scene that is older than `old` [s], unless the robot itself `sees`.
        """
        self._node, self._begin, self._sees = node, begin, sees
        self.feasibility = feasibility
        self.release_namespace = lock_namespace(node)  # a second robot ends here
        self.session, self._door = Session(), SceneDoor(old)
        self._before: SeenScene | None = None  # of the push that is under way
        self._after: SeenScene | None = None  # the latest with as many bodies
        self._push, self._began, self._ended = Push(), 0.0, 0.0
        self._doubt: BaseException | None = None  # that the stroke has moved a body
        self._rested = -inf  # when bodies were seen at rest last [s], of the clock of headers
        self.conflict = ""
        self.owned: tuple[str, ...] = ("push_result",)
        self._late = inf  # when bodies have moved for too long [s], of a steady clock
        self.counts = {"executed": 0, "refused": 0}
        self.now = lambda: float(node.get_clock().now().nanoseconds * 1e-9)
        results = node.create_publisher(PushResult, "push_result", QUEUE)
        self.answer: Callable[[PushResult], None] = results.publish
        self.reception = Reception(node)
        if not sees:
            self._scenes = self.reception.listen(Scene, "scene", self._on_scene, RELIABLE)
            self.reception.listen(BodiesMessage, "shapes", self._on_bodies, LATCHED_QUEUE)
        self.reception.listen(Push, "push", self._on_push, QUEUE, self.answer_refused)
        steady_timer(node, LOOK, self._look)

    @property
    def busy(self) -> bool:
        """Whether a push is under way."""
        return self._before is not None

    @property
    def unseen(self) -> float:
        """How long [s] no scene at rest has come after a stroke; 0: none is waited for any more."""
        seen, now = self._door.seen, self.now()
        waits = 0.0 <= now - self._ended < LONGEST_UNSEEN
        if not waits or seen is None or seen.episode_id != self._push.episode_id:
            return 0.0
        return max(now - max(self._rested, self._ended), 0.0)

    @property
    def scene(self) -> SceneArray | None:
        """The bodies (N, 8) as they were seen last."""
        return None if self._door.seen is None else self._door.seen.disks

    @property
    def push_id(self) -> int:
        """The id of the push that is under way; 0: none is."""
        return int(self._push.push_id) if self.busy else 0

    @property
    def seen_after(self) -> SceneArray | None:
        """The bodies (N, 8) as they were seen last after a stroke; None: they were not yet."""
        seen = self._after if self.busy else None
        return seen.disks if seen is not None and seen.stamp > self._ended + MARGIN else None

    @property
    def before(self) -> tuple[SceneArray, Bodies]:
        """The scene (N, 8) in which the push that is under way came, and its bodies."""
        assert self._before is not None and self._door.bodies is not None
        return self._before.disks, self._door.bodies

    def set_scene(self, message: Scene, bodies: Bodies) -> None:
        """Take the scene that a robot sees by itself, between two pushes."""
        self.session.go_on_from(message.episode_id, message.scene_id)
        self._door.hold(SeenScene.of(message), bodies)

    def check_stroke(self) -> None:
        """Raise `StaleSceneError` where bodies are not seen where they were when the push came."""
        take_waiting(self._scenes)
        if self._before is not None:
            self._door.check_stroke(self._before, monotonic(), self.now())

    def finish(self, ended: float, doubt: BaseException | None = None) -> None:
        """Take note that the stroke ended at a time [s], and the tool is away; bodies moved.

        With a `doubt` the push is refused for that if no body is seen to have moved.
        """
        if self.busy:
            self._ended, self._late, self._doubt = ended, monotonic() + LONGEST, doubt

    def conclude(self, after: Scene, measured: PushResult | None = None) -> None:
        """End the push that is under way as executed, with the bodies as they are after it.

        A robot may have `measured` its duration and wall time, and predicted its result.
        """
        if (before := self._before) is None:
            return
        scene = Scene(header=after.header, disks=after.disks, settled=after.settled)
        scene.episode_id, scene.scene_id = before.ids[0], before.ids[1] + 1
        self._before, self._late = None, inf
        self.session.finish(executed=True)
        self.counts["executed"] += 1
        result = measured or PushResult(duration=max(self._ended - self._began, 0.0))
        result.error_code = int(ErrorCode.OK)
        result.header = codec.header(codec.encode_time(round(1e9 * self._ended)))
        self._answer(result, self._push, before.message, scene)

    def refuse(self, error: BaseException) -> None:
        """Refuse the push that is under way: no body was moved, and none will be."""
        if self.busy:
            self._before = None
            self.session.finish(executed=False)
            self.answer_refused(self._push, error)

    def answer_refused(self, message: Push, error: BaseException) -> None:
        """Answer that a push was not made."""
        code, text = error_reply(error)
        self.counts["refused"] += 1
        warn_of_refusal(
            self._node,
            code,
            f"push {message.push_id} from {message.source!r} refused: {shortened(text)}",
        )
        scene = Scene() if self._door.seen is None else self._door.seen.message
        result = PushResult(error_code=int(code), error_message=shortened(text))
        result.header = codec.header(codec.encode_time(round(1e9 * self.now())))
        self._answer(result, message, scene, scene)

    def _answer(self, result: PushResult, push: Push, before: Scene, after: Scene) -> None:
        result.push_id, result.episode_id, result.push = push.push_id, push.episode_id, push
        result.before, result.after = before, after
        self.answer(result)

    def _on_push(self, message: Push) -> None:
        """Begin to push, or raise why not: `Reception` makes the code of the refusal of that."""
        seen, bodies = self._door.seen, self._door.bodies
        if seen is None or bodies is None or self._door.episode_id != seen.ids[0]:
            what = "scene" if seen is None else "shapes of this episode"
            trouble = f": {self._door.trouble}" if self._door.trouble else ""
            hint = "send the push anew later" if self._sees else MAKER
            raise BusyError(f"no {what} came yet{trouble}; {hint}")
        if not self.session.busy:
            self.session.go_on_from(*seen.ids)
        self.session.admit(message.push_id, message.episode_id, message.scene_id)
        try:
            stroke = self._checked(message, seen, bodies)
            self._push, self._before, self._began = message, seen, self.now()
            self._after, self._doubt = None, None
            self._ended = self._late = inf
            self._begin(message, stroke)
        except Exception:
            self._before = None
            self.session.finish(executed=False)
            raise

    def _checked(self, message: Push, seen: SeenScene, bodies: Bodies) -> Stroke:
        """Return the stroke of a push that can be carried out.

        The push may state where its planner takes the bodies to be. A robot that sees them by
        itself compares; others take that in place of what they were sent.
        """
        push, planned_from = wire.decode_push(message), None
        if message.disks:
            name = "scene of the push"
            planned_from = wire.check_bodies(wire.decode_disks(message.disks, name), name)
        if self._sees:
            scene, at_rest = seen.disks, seen.settled
        else:
            self._door.check_push(monotonic(), self.now())
            scene = seen.disks if planned_from is None else planned_from
            at_rest, planned_from = seen.at_rest, None
        return checked_stroke(push, scene, at_rest, self.feasibility, bodies, planned_from)

    def _on_bodies(self, message: BodiesMessage) -> None:
        self._door.state_bodies(decode_bodies(message), message.episode_id, monotonic())

    def _on_scene(self, message: Scene) -> None:
        """Take note of a scene; the first at rest after a push is where that led."""
        seen, before = self._door.take(message, monotonic(), self.now()), self._before
        self._rested = seen.stamp if seen.at_rest else self._rested
        if before is None or len(seen.disks) != len(before.disks):
            return
        if find_second_publisher(self._node, ("scene",)):
            return  # either may be wrong
        self._after = seen
        if seen.stamp < self._ended + AFTER or not seen.at_rest:
            return
        if self._doubt is not None and _looks_same(before, seen):
            self.refuse(self._doubt)
        else:
            self.conclude(Scene(header=message.header, disks=message.disks, settled=True))

    def _look(self) -> None:
        self.conflict = find_second_publisher(self._node, self.owned)
        if monotonic() > self._late and (last := self._after or self._before) is not None:
            self._node.get_logger().error(
                f"bodies did not come to rest within {LONGEST:g} s after push {self._push.push_id}"
            )
            self.conclude(Scene(header=last.message.header, disks=last.message.disks))


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
