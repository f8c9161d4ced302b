"""The episodes of a simulator: how one begins, and how it goes on where another process crashed."""

from dataclasses import dataclass, replace
from typing import Final

from sain_core.errors import BusyError, CancelledError, ErrorCode, SainError
from sain_core.guarding.ros.reception import introspect, shortened
from sain_core.guarding.ros.state_file import StateFile, Subscribers, id_in, message_of, text_of
from sain_core.ros import codec
from sain_core.ros.node_main import steady_timer
from sain_core.ros.worker import Worker
from sain_interfaces.msg import Push, PushResult
from sain_interfaces.srv import ResetScene
from sain_sim.ros.publishing import Publishing
from sain_sim.world.workcell import Sample

LOOK_AGAIN: Final = 0.1  # [s] between looks for those who listened before a crash
HEARD: Final = "push_result"  # by all who follow an episode
LATEST: Final = 2.0**31 - 1e5  # [s], simulated: stamps hold 32 bits
LOST_TIME: Final = 60.0  # [s], simulated: the clock had gone on, and never goes back


@dataclass(frozen=True, eq=False)
class LeftEpisode:
    """A settled scene, and all that it takes to be there again."""

    reset: ResetScene.Request  # leads to the scene: seed, world, bodies, friction
    episode_id: int  # as in `Session`
    scene_id: int  # likewise
    time: float  # simulated [s]
    push: Push | None = None  # the one that was under way, if any
    unsent: PushResult | None = None  # the result that led to the scene, until it is published
    subscribers: int = 0  # of the results of pushes

    def write(self, file: StateFile) -> None:
        """Replace what a file holds."""
        kept = vars(self) | {"reset": text_of(self.reset)}
        for name in ("push", "unsent"):
            kept[name] = "" if kept[name] is None else text_of(kept[name])
        file.write(**kept)

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


class Episodes:
    """Begins episodes, and keeps what it takes to go on from the latest scene.

    Attributes:
        waits: whether not all listen again who did before a crash.
    """

    def __init__(self, publishing: Publishing, worker: Worker) -> None:
        """Start the first episode, or go on from the state file.

        Raises:
            DatasetError: the file is damaged.
        """
        self._publishing, self._worker = publishing, worker
        self._node, self._simulator = publishing.node, publishing.simulator
        self._driver = driver = publishing.driver
        self._session = driver.session
        self._publish, driver.answer = driver.answer, self._answer
        self._push: Push | None = None  # under way
        self._file = StateFile(self._node, self._simulator.config.state_file)
        self._kept: LeftEpisode | None = None
        left = LeftEpisode.read(self._file)
        self.waits, self._count = left is not None, 0 if left is None else left.subscribers
        self._subscribers = Subscribers(self._node, HEARD, self._count)
        if left is None:
            self._reset(ResetScene.Request(seed=self._simulator.config.seed))
        else:
            self._go_on_from(left)
        service = driver.reception.serve(ResetScene, "reset_scene", self._on_reset)
        introspect(self._node, service, self._simulator.config.service_introspection)

    @property
    def rests(self) -> bool:
        """Whether nothing happens to the bodies."""
        return not (self._session.busy or self.waits)

    # --- how they begin -------------------------------------------------------------------------

    def _on_reset(
        self, request: ResetScene.Request, response: ResetScene.Response
    ) -> ResetScene.Response:
        try:
            self._reset(request)
        except SainError as error:
            self._node.get_logger().warning(f"reset refused: {shortened(str(error))}")
            raise
        finally:
            response.scene = self._publishing.settled
        return response

    def _reset(self, request: ResetScene.Request) -> None:
        self._session.check_idle()
        sample = self._place(request)
        self._session.begin_episode()
        self._publishing.take(sample)
        self._announce()

    def _place(self, request: ResetScene.Request) -> Sample:
        """Bring the world to where a request has it."""
        self._simulator.pacer.idle()
        sample = self._worker.call(lambda: self._simulator.reset(request))
        self._begun = request
        return sample

    def _announce(self) -> None:
        """Publish all about an episode from its start."""
        self.waits = False
        self._publishing.episode(self._begun)
        self._keep()
        self._publishing.settle()

    # --- pushes ---------------------------------------------------------------------------------

    def begin(self, push: Push) -> None:
        """Keep a push that is begun, so that it is answered also after a crash.

        Raises:
            BusyError: not all listen again.
        """
        if self.waits:
            raise BusyError("the simulator goes on after a crash; send the push anew later")
        self._push = push
        self._keep()

    def _answer(self, result: PushResult) -> None:
        """Publish a result; that of a push that was begun is kept before, and never taken back."""
        if self._push is None or self._session.busy:
            self._publish(result)
            return
        self._push = None
        self._publishing.take(self._publishing.sample)
        self._keep(unsent=result)
        self._publish(result)
        self._keep()
        if result.error_code == ErrorCode.OK:
            self._publishing.settle()

    # --- after a crash --------------------------------------------------------------------------

    def _keep(self, unsent: PushResult | None = None) -> None:
        """Keep what it takes to go on from here: the push under way, or its result, too."""
        if not self._file:
            return
        begun, disks = self._begun, codec.encode_disks(self._publishing.sample.scene)
        friction = self._simulator.parameters.friction
        reset = ResetScene.Request(seed=begun.seed, world=begun.world, friction=friction)
        reset.disks, reset.shapes, reset.roles = disks, begun.shapes, begun.roles
        ids, now = (self._session.episode_id, self._session.scene_id), self._simulator.pacer.now
        self._kept = LeftEpisode(reset, *ids, now, self._push, unsent, self._count)
        self._kept.write(self._file)

    def look_around(self) -> None:
        """Note who listens, at once: before the first reset nothing else may be noted."""
        found = self._subscribers.count() if self._file and not self.waits else self._count
        if found != self._count and self._kept is not None:
            self._count, self._kept = found, replace(self._kept, subscribers=found)
            self._kept.write(self._file)

    def _go_on_from(self, left: LeftEpisode) -> None:
        """Take up ids, time and scene of another process, and wait for those who listened."""
        last = left.push or left.unsent
        push_id = 0 if last is None else last.push_id
        self._session.go_on_from(left.episode_id, left.scene_id, push_id)
        self._simulator.pacer.go_on_from(left.time + LOST_TIME)
        where = f"scene {left.scene_id} of episode {left.episode_id}"
        self._node.get_logger().warning(f"goes on from {where} after a crash")
        self._publishing.take(self._place(left.reset))
        steady_timer(self._node, LOOK_AGAIN, lambda: self._look_for_listeners(left))

    def _look_for_listeners(self, left: LeftEpisode) -> None:
        """Publish all again, once they listen again, that somebody may not have received."""
        if not self.waits or not self._subscribers.complete():
            return
        if left.unsent is not None:
            self._publish(left.unsent)
        self._announce()
        if left.push is not None:
            text = f"push {left.push.push_id} ended when the simulator crashed; it moved nothing"
            self._driver.answer_refused(left.push, CancelledError(text))
