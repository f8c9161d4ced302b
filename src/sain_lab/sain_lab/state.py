"""What follows from the log of a laboratory: beliefs, bets, the episode and the training under way.

A state changes in one way: `take` a record that is in the log. So a learner that was killed has the
same state again once it has read the log.

The belief takes a push when no running episode conditions on it any more: when another episode has
begun, or when it is older than the latest `MOST_PUSHES` of its own. Until then
`model.condition(history)` counts it, and nothing counts it twice.
"""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from sain_core.scene import POSITION, THETA, wrap_angle
from sain_core.transitions import PushHistory
from sain_core.types import Scene
from sain_lab.judging.judge import Judge
from sain_lab.physics import Believer, BodyBeliever
from sain_lab.storage import log
from sain_lab.storage.results import Result, history_of
from sain_model.dynamics.sain import SainDynamics
from sain_mppi.agent.agent import MOST_PUSHES

MOST_JUMP: Final = (0.003, 0.05)  # [m], [rad], that a body may move between two pushes
BEFORE: Final = "it was learned from before"


@dataclass(frozen=True)
class Job:
    """A training: on so many pushes of a laboratory, into this folder."""

    pushes: int
    service: str


class State:
    """The state of a laboratory.

    Attributes:
        believer: what is believed of the physics.
        bodies: likewise of bodies that have names.
        judge: the bets between contenders.
        pushes: learned from.
        seen: by identity and digest of each result that was taken, why it is not taken again.
        trained_at: pushes at the latest training.
        stated: likewise when parameters were logged last.
        unnamed: pushes of bodies without a name, which networks learn from.
        training: that was begun and did not end.
        unseen: pushes since its begin, each with the history of its episode.
        networks: folders of all trainings.
        problems: texts of what failed and was logged once.
        jumped: whether it was logged that parameters have jumped.
    """

    def __init__(self, shipped: SainDynamics) -> None:
        self.believer, self.bodies, self.judge = Believer(shipped), BodyBeliever(), Judge()
        self.pushes = self.trained_at = self.stated = self.unnamed = 0
        self.seen: dict[str, str] = {}
        self.training: Job | None = None
        self.unseen: list[tuple[Result, PushHistory]] = []
        self.networks: set[str] = set()
        self.problems: set[str] = set()
        self.jumped = False
        self._episode = ""  # the running one
        self._latest: deque[Result] = deque()  # its pushes that a model is conditioned on
        self._last: Scene | None = None  # where it is now

    def take(self, record: Mapping[str, Any]) -> None:
        """Take a record that is in the log."""
        match record["kind"]:
            case "push":
                self._learn(Result.of_record(record), record["errors"])
            case "end":
                self._end_episode()
            case "belief":
                self.stated = record["pushes"]
            case "event":
                self.judge.take(record)
                self._take_event(record["event"], record, record["about"])

    def _take_event(self, kind: str, record: Mapping[str, Any], about: Mapping[str, Any]) -> None:
        match kind:
            case log.TRAINING:
                self.training = Job(record["pushes"], about["model"])
                self.trained_at, self.unseen = record["pushes"], []
                self.networks.add(about["model"])
            case log.TRAINED | log.FAILED:
                self.training, self.unseen = None, []
                self.networks |= {about["model"]} if kind == log.TRAINED else set()
            case log.JUMPED:
                self.jumped = True
            case log.NOT_PREDICTED | log.NOT_REMOVED:
                self.problems.add(record["text"])
            case log.NOT_LEARNED:
                self.seen[about["id"]] = f"it was left out before: {record['text']}"
                if "after" in about:
                    self._note(about["episode"], np.array(about["after"], np.float64))

    def _learn(self, result: Result, errors: Mapping[str, float]) -> None:
        self.seen |= {result.identity: BEFORE, result.digest: BEFORE}
        if self.training is not None:
            self.unseen.append((result, self.history(result)))
        self._note(result.episode or result.identity, result.after)
        self._latest.append(result)
        while len(self._latest) > MOST_PUSHES:
            self._believe(self._latest.popleft())
        self.pushes += 1
        self.unnamed += not result.object
        self.judge.update(errors)

    def _note(self, episode: str, after: Scene) -> None:
        """Take note of a push of the running episode; the belief takes those that ran out."""
        if episode != self._episode:
            self._end_episode()
            self._episode = episode
        self._last = after

    def _end_episode(self) -> None:
        while self._latest:
            self._believe(self._latest.popleft())
        self._episode, self._last = "", None

    def _believe(self, result: Result) -> None:
        (self.bodies if result.object else self.believer).add(result)

    @property
    def conditions(self) -> bool:
        """Return True if a running episode conditions on pushes."""
        return bool(self._latest)

    def history(self, result: Result) -> PushHistory:
        """Return the earlier pushes of the episode of a result."""
        latest = list(self._latest) if result.episode == self._episode else []
        if not latest or len(latest[0].push) != len(result.push):
            return PushHistory.empty(len(result.before))
        return history_of(latest)

    def why_not(self, result: Result) -> str:
        """Return why a result cannot follow the running episode; empty: it can."""
        if self._last is None or not result.episode or result.episode != self._episode:
            return ""
        others = self._latest and self._latest[-1].own_bodies != result.own_bodies
        if others or len(self._last) != len(result.before):
            return "its bodies are others than before in this episode"
        return _jump(self._last, result)


def _jump(last: Scene, result: Result) -> str:
    """Return which body is elsewhere than the last push left it; empty: none is."""
    before = result.before
    way = np.hypot(*(before - last)[:, POSITION].T)
    turn = np.abs(wrap_angle(before[:, THETA] - last[:, THETA]))
    noise = 0.0 if result.noise is None else 3.0 * result.noise
    jumped = (way > MOST_JUMP[0] + noise) | (turn > MOST_JUMP[1] + noise / before[:, 7])
    if not jumped.any():
        return ""
    body = int(np.argmax(jumped))
    return (
        f"body {body} is {1e3 * way[body]:.1f} mm and {np.degrees(turn[body]):.1f} degrees from"
        " where the last push left it: somebody moved it"
    )
