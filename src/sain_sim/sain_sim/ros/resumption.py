"""What a simulator keeps of its episode, so that another process goes on where it crashed."""

from dataclasses import dataclass, replace
from typing import Final

from rclpy.node import Node

from sain_core.guarding.ros.state_file import StateFile, Subscribers, id_in, message_of, text_of
from sain_core.guarding.session import Session
from sain_core.ros import codec
from sain_core.types import Scene
from sain_interfaces.msg import Push, PushResult
from sain_interfaces.srv import ResetScene
from sain_sim.ros.pacing import Pacer

HEARD: Final = "push_result"  # by all who follow an episode
LATEST: Final = 2.0**31 - 1e5  # [s], simulated: stamps hold 32 bits
LOST_TIME: Final = 60.0  # [s], simulated: the clock had gone on, and never goes back


@dataclass(frozen=True, eq=False)
class LeftEpisode:
    """A settled scene, and all that it takes to be there again.

    Attributes:
        reset: what leads to the scene: seed, world, bodies with masses and radii, friction.
        episode_id: as in `Session`.
        scene_id: as in `Session`.
        time: simulated [s].
        push: the one that was under way; None: there was none.
        unsent: the result that led to the scene, until it is published; None: it was.
        subscribers: of the results of pushes.
    """

    reset: ResetScene.Request
    episode_id: int
    scene_id: int
    time: float
    push: Push | None = None
    unsent: PushResult | None = None
    subscribers: int = 0

    def write(self, file: StateFile) -> None:
        """Replace what a file holds."""
        file.write(
            reset=text_of(self.reset),
            episode_id=self.episode_id,
            scene_id=self.scene_id,
            time=self.time,
            push="" if self.push is None else text_of(self.push),
            unsent="" if self.unsent is None else text_of(self.unsent),
            subscribers=self.subscribers,
        )

    @classmethod
    def read(cls, file: StateFile) -> "LeftEpisode | None":
        """Return what a file holds; None: nothing.

        Raises:
            DatasetError: it is damaged.
        """
        if not (state := file.read()):
            return None
        with file.decoding():
            ids = id_in(state, "episode_id"), id_in(state, "scene_id")
            push = message_of(Push, state["push"]) if state["push"] else None
            unsent = message_of(PushResult, state["unsent"]) if state["unsent"] else None
            reset = message_of(ResetScene.Request, state["reset"])
            time = float(state["time"])
            if not 0.0 <= time < LATEST:
                raise ValueError(f"time is {time} s; allowed: 0 to {LATEST:.0f} s")
            return cls(reset, *ids, time, push, unsent, id_in(state, "subscribers"))


class Resumption:
    """The state of a simulator in a file, and the wait for those who listened before a crash.

    Attributes:
        waits: whether not all listen again yet.
    """

    def __init__(self, node: Node, path: str, session: Session, pacer: Pacer) -> None:
        """Go on from the file at a path; empty: there is none.

        Raises:
            DatasetError: it is damaged.
        """
        self._node, self._session, self._pacer = node, session, pacer
        self._file = StateFile(node, path)
        self._left = left = LeftEpisode.read(self._file)
        self.waits = left is not None
        self.lost = None if left is None else left.push  # under way when the process crashed
        self.unsent = None if left is None else left.unsent  # a result that was not published
        self._count = 0 if left is None else left.subscribers
        self._moment: LeftEpisode | None = None  # the latest that was kept
        self._subscribers = Subscribers(node, HEARD, self._count)

    def resume(self) -> ResetScene.Request | None:
        """Take up ids and time of another process; return what leads to its scene, if any."""
        left = self._left
        if left is None:
            return None
        last = left.push or left.unsent
        push_id = 0 if last is None else last.push_id
        self._session.go_on_from(left.episode_id, left.scene_id, push_id)
        self._pacer.go_on_from(left.time + LOST_TIME)
        where = f"scene {left.scene_id} of episode {left.episode_id}"
        self._node.get_logger().warning(f"goes on from {where} after a crash")
        return left.reset

    def keep(
        self,
        begun: ResetScene.Request,
        scene: Scene,
        friction: float,
        push: Push | None,
        unsent: PushResult | None,
    ) -> None:
        """Replace the state: an episode that began with a request, and is in a scene (N, 8)."""
        if not self._file:
            return
        reset = ResetScene.Request(seed=begun.seed, world=begun.world, friction=friction)
        reset.disks = codec.encode_disks(scene)
        reset.shapes, reset.roles = begun.shapes, begun.roles
        ids = self._session.episode_id, self._session.scene_id
        self._moment = LeftEpisode(reset, *ids, self._pacer.now, push, unsent, self._count)
        self._moment.write(self._file)

    def all_listen(self) -> bool:
        """Return whether all who listened before a crash listen again, or have had their time."""
        return self._subscribers.complete()

    def look_around(self) -> None:
        """Note who listens, at once: before the first reset nothing else may be noted."""
        found = self._subscribers.count() if self._file else 0
        if found == self._count:
            return
        self._count = found
        if self._moment is not None:
            self._moment = replace(self._moment, subscribers=found)
            self._moment.write(self._file)
