"""What a planner keeps for after a crash, and what no message says: who listens, who serves."""

from collections.abc import Callable, Iterable
from math import inf
from time import monotonic
from typing import Final

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node

from sain_core import wire
from sain_core.errors import ErrorCode, SainError
from sain_core.guarding.ros.ownership import find_second_publisher
from sain_core.guarding.ros.state_file import StateFile, Subscribers, id_in, message_of, text_of
from sain_core.ros.codec import decode_time
from sain_core.ros.node_main import ERROR, OK, WARN, Diagnostics, node_of, steady_timer
from sain_core.world import PushRecord
from sain_interfaces.msg import Goal, Plan, PushResult
from sain_mppi.agent.agent import MOST_PUSHES
from sain_mppi.agent.events import PushEnded
from sain_mppi.ros.remote import RemoteRollout


def event_of(message: PushResult, logger: RcutilsLogger) -> PushEnded:
    """Return what a result says; one whose scenes cannot be read has no record."""
    record = None
    if message.error_code == ErrorCode.OK:
        try:
            before, push, after = wire.decode_result(message)
            record = PushRecord(push, before, after)
        except SainError as error:
            logger.warning(f"push {message.push_id} is left out of the history: {error}")
    time = decode_time(message.header.stamp)
    about = message.episode_id, message.error_message
    return PushEnded(message.push_id, message.error_code, time, record, *about)


class Notes:
    """The goal that is followed, the pushes sent for it, and what the episode's pushes led to."""

    def __init__(self, node: Node, path: str) -> None:
        """Keep them at this path, and begin with what is there; empty: keep nothing.

        Raises `DatasetError`: what is there is damaged.
        """
        self._file = StateFile(node, path)
        self.goal: Goal | None = None
        self.pushes = 0
        self.plans = 0  # made so far
        self.heard: list[int] = []  # goals, by when they were sent
        self.subscribers = 0  # of plans
        self.results: list[PushResult] = []
        self._read()

    def set_goal(self, goal: Goal, heard: Iterable[int]) -> None:
        """Note a new goal, and the goals that were heard so far."""
        self.goal, self.pushes, self.heard = goal, 0, list(heard)
        self.write()

    def set_subscribers(self, count: int) -> None:
        """Note how many subscribe to plans."""
        if count != self.subscribers:
            self.subscribers = count
            self.write()

    def count(self, pushes: int) -> None:
        """Note how many pushes were sent for the goal."""
        self.pushes = pushes
        self.write()

    def add_plan(self, plan: Plan) -> None:
        """Note a plan, and whether the goal is still followed after it."""
        self.plans = plan.plan_id
        over = plan.status != Plan.PUSH
        if over and self.goal is not None and self.goal.goal_id == plan.goal_id:
            self.goal = None
        self.write()

    def add_result(self, result: PushResult, pushes: int) -> None:
        """Note what a push led to."""
        same = [one for one in self.results if one.episode_id == result.episode_id]
        self.results = [*same, result][-MOST_PUSHES:]
        self.count(pushes)

    @property
    def kept(self) -> bool:
        """Whether there is a file."""
        return bool(self._file)

    def write(self) -> None:
        """Write all of it."""
        self._file.write(
            goal="" if self.goal is None else text_of(self.goal),
            pushes=self.pushes,
            plans=self.plans,
            heard=self.heard,
            subscribers=self.subscribers,
            results=[text_of(result) for result in self.results],
        )

    def _read(self) -> None:
        state = self._file.read()
        if not state:
            return
        with self._file.decoding():
            self.goal = message_of(Goal, state["goal"]) if state["goal"] else None
            self.pushes, self.plans = id_in(state, "pushes"), id_in(state, "plans")
            self.heard = [int(stamp) for stamp in state["heard"]]
            self.subscribers = id_in(state, "subscribers")
            self.results = [message_of(PushResult, text) for text in state["results"]]


LOOK_AGAIN: Final = 0.1  # [s] between looks for the model, and for messages that do not come
LOOK_AROUND: Final = 1.0  # [s] between looks for who listens
LOOK_FOR_PLANNERS: Final = 0.5  # [s] between looks for others
SCENE_NODE: Final = "scene_node"
SILENCE: Final = 3.0  # [s] after which what it reported is past
NO_MODEL: Final = "no model is ready yet: plans use physics without learning"


class PeerWatch:
    """Looks about with timers, and reports what it sees as diagnostics."""

    def __init__(
        self, node: Node, diagnostics: Diagnostics, remote: RemoteRollout | None, notes: Notes
    ) -> None:
        self._node, self._diagnostics = node, diagnostics
        self._remote, self._notes = remote, notes
        before = notes.subscribers or int(notes.goal is not None)
        self._subscribers = Subscribers(node, "plan", before)
        self._conflict = ""
        self._scenes = node.resolve_topic_name(SCENE_NODE)
        self._trouble = -inf, ""  # when the source of scenes reported what is wrong, and what
        self._waits = False  # for a scene at rest, as was reported
        self._starting = True  # until a model serves, or a plan says more
        diagnostics.set(WARN, NO_MODEL)

    def begin(self, look_again: Callable[[], None], waits_for_rest: Callable[[], bool]) -> None:
        """Look from now on.

        `look_again` is called at each look; `waits_for_rest` tells whether a goal waits for a
        scene at rest.
        """
        steady_timer(self._node, LOOK_AGAIN, self._look)
        steady_timer(self._node, LOOK_AGAIN, lambda: self._look_for_rest(waits_for_rest()))
        steady_timer(self._node, LOOK_AGAIN, look_again)
        steady_timer(self._node, LOOK_FOR_PLANNERS, self._look_for_planners)
        if self._notes.kept:
            steady_timer(self._node, LOOK_AROUND, self._look_around)

    @property
    def ready(self) -> bool:
        """Whether to act: those who listened before are back, and no model is about to serve."""
        return self._subscribers.complete() and not (
            self._remote is not None and self._remote.starting
        )

    def report(self, level: bytes, message: str, **figures: object) -> None:
        """Report what became of a plan: it says more than the looks for a model."""
        self._starting = self._waits = False
        self._diagnostics.set(level, message, **figures)

    def _look(self) -> None:
        if self._starting and (self._remote is None or self._remote.ready):
            self._starting = False
            self._diagnostics.set(OK, "ready")
        elif self._starting and self._remote is not None:
            doing = self._remote.starting
            self._diagnostics.set(WARN, f"waits for the model: {doing}" if doing else NO_MODEL)

    def on_diagnostics(self, message: DiagnosticArray) -> None:
        """Take note of what the source of scenes reports."""
        for status in message.status:
            if node_of(status) == self._scenes:
                self._trouble = monotonic(), "" if status.level == OK else status.message

    def _look_for_rest(self, waits: bool) -> None:
        """Report why a goal waits, as long as it does."""
        since, trouble = self._trouble
        if waits and trouble and monotonic() - since < SILENCE:
            self._waits = True
            self._diagnostics.set(WARN, f"waits for a scene at rest: {trouble}")
        elif self._waits:
            self._waits = False
            self._diagnostics.set(OK, "ready")

    def _look_around(self) -> None:
        if self._subscribers.complete():
            self._notes.set_subscribers(self._subscribers.count())

    def _look_for_planners(self) -> None:
        # people and players send pushes, too
        before, self._conflict = self._conflict, find_second_publisher(self._node, ("plan",))
        if self._conflict:
            self._diagnostics.set(ERROR, self._conflict)
        elif before:
            self._diagnostics.set(OK, "ready")
