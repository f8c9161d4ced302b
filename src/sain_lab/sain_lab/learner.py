"""The learner: results in, and out come the belief, networks and decisions of a laboratory.

    with Learner.named("my_table") as learner:          # or a path; locked by this process
        lesson = learner.observe(Result(before, push, after, bodies, episode="run 7/12"))
        lesson.learned, lesson.reason                    # False: why nothing was learned from it
        lesson.errors                                    # {"planar": 1.7, "physics": 1.2, ...} [mm]
        lesson.events                                    # what was decided: Event(kind, text, ...)
        learner.poll()                                   # a training that ended: more events
        learner.generation                               # changes when others should load again:
        learner.model, learner.model_name                # a model; "lab:PATH" for `load_model`

1. A push is predicted by all contenders before anything is learned from it, with the episode's
   earlier pushes as in deployment: `planar`, `physics` (as believed), the network in service, and
   a candidate. The push and its errors are one record of the log.
2. The belief takes a push when no running episode conditions on it any more: when another episode
   has begun, or when it is older than the latest `MOST_PUSHES` of its own. Until then
   `model.condition(history)` counts it, and nothing counts it twice.
3. A network is trained in a process of its own (`sain_lab.training`) when the pushes have grown by
   half since the last one. It becomes the candidate, goes into service when it errs less beyond
   chance on pushes that it has not seen, and out when it errs more (`sain_lab.judging.betting`).

All state is in the log: a learner that opens a laboratory reads it, and goes on.
"""

import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Self

import numpy as np

from sain_core.errors import SainError
from sain_core.push import pushed_bodies
from sain_core.scene import POSITION, THETA, wrap_angle
from sain_core.transitions import MOVED, PushHistory
from sain_core.types import Scene
from sain_lab.bodies import BodyBeliever
from sain_lab.judging.events import CHANGED, FAILED, JUMPED, TRAINED, TRAINING, Event
from sain_lab.judging.judge import RECENT, Judge
from sain_lab.keeping.laboratory import PHYSICS, PLANAR, OpenLaboratory
from sain_lab.keeping.results import Result, history_of, why_not
from sain_lab.physics import Believer
from sain_lab.serving import model_name, planar
from sain_lab.training import Training
from sain_model.dynamics.load import load_checkpoint, load_shipped
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.kinds import FRICTION, write_belief
from sain_mppi.agent.agent import MOST_PUSHES

FIRST_TRAINING: Final = 50  # pushes
GROWTH: Final = 1.5  # of the number of pushes from one training to the next
RECENT_PUSHES: Final = 12  # that show whether the table has changed
MOST_JUMP: Final = (0.003, 0.05)  # [m], [rad], that a body may move between two pushes


@dataclass(frozen=True)
class Lesson:
    """What became of a result.

    Attributes:
        learned: whether it was learned from.
        reason: why not; empty: it was.
        errors: mean error of bodies that moved [mm], by contender.
        turns: likewise of headings [degrees].
        events: what was decided.
    """

    learned: bool
    reason: str = ""
    errors: Mapping[str, float] = field(default_factory=dict)
    turns: Mapping[str, float] = field(default_factory=dict)
    events: tuple[Event, ...] = ()


class Learner:
    """Learns in one laboratory. Pure Python; every call returns within a second."""

    def __init__(self, laboratory: OpenLaboratory, trains: bool = True) -> None:
        """Go on where the log ends.

        Args:
            laboratory: open; closed with the learner.
            trains: whether networks are trained at all.

        Raises:
            DatasetError, CheckpointError: the laboratory is damaged.
        """
        self.laboratory, self._trains = laboratory, trains
        self._shipped, self._planar = load_shipped(), planar()
        self.believer, self.bodies = Believer(self._shipped), BodyBeliever()
        self.judge = Judge()
        self.pushes = 0
        self._seen: set[str] = set()
        self._trained_at = self._stated = self._since = 0  # pushes then
        self._unnamed = 0  # pushes of bodies without a name, which networks learn from
        self._pending = False  # a training was begun
        self._jumped = False  # it was said that friction has jumped
        self._recent: deque[Result] = deque(maxlen=RECENT_PUSHES)
        self._episode = ""  # the running one
        self._latest: deque[Result] = deque()  # its pushes that a model is conditioned on
        self._last: Scene | None = None  # where it is now
        self._training: Training | None = None
        self._networks: dict[str, SainDynamics] = {}
        for record in laboratory.records():
            self._take(record)
        self._settle()
        self._publish()

    @classmethod
    def named(cls, name: str, trains: bool = True) -> Self:
        """Return the learner of a laboratory by name or path; it is made where there is none."""
        return cls(OpenLaboratory.named(name), trains)

    @property
    def generation(self) -> int:
        """How often what is in service has changed, its belief too."""
        return self.laboratory.manifest.generation

    @property
    def model(self) -> SainDynamics:
        """What is in service, for an episode that begins; see `sain_core.model.Model`."""
        model = self._contender(self.judge.service)
        assert model is not None
        return model

    @property
    def model_name(self) -> str:
        """The name by which another process loads what is in service."""
        return model_name(self.laboratory.path)

    def observe(self, result: Result) -> Lesson:
        """Learn from a result.

        Raises:
            OutputError: the disk is full; nothing was learned, and the laboratory is whole.
        """
        result = result.identified()
        if {result.identity, result.digest} & self._seen:
            return Lesson(False, "it was learned from before")
        if reason := why_not(result) or self._why_not_here(result):
            event = self._event("not learned", reason, id=result.identity)
            self._append(event.record())
            if not why_not(result):
                self._note(result)
            return Lesson(False, reason, events=(event,))
        errors, turns = self._predict(result)
        record = {"kind": "push", **result.record(), "errors": errors, "turns": turns}
        self._append(record)
        decided = self._settle()
        self._publish()
        noticed = self._notice_jump()
        return Lesson(True, "", errors, turns, (*decided, *noticed, *self._train_if_due()))

    def poll(self) -> tuple[Event, ...]:
        """Take a training that has ended; return what follows from it."""
        training = self._training
        if training is None or training.running:
            return ()
        self._training = None
        return self._finish(training)

    def wait(self) -> tuple[Event, ...]:
        """Wait for a training under way; return what follows from it."""
        if self._training is not None:
            self._training.wait()
        return self.poll()

    def end_episode(self) -> None:
        """Let the belief take all pushes: nothing conditions on the running episode any more."""
        if self._latest:
            self._append({"kind": "end"})
        self._publish()

    def close(self) -> None:
        """Stop a training, and let another process have the laboratory."""
        if self._training is not None:
            self._training.stop()
        self.laboratory.close()

    def __enter__(self) -> Self:
        """Return the learner."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    # --- what the log says ------------------------------------------------------------------------

    def _append(self, record: dict[str, Any]) -> None:
        self.laboratory.append(record)
        self._take(record)

    def _take(self, record: Mapping[str, Any]) -> None:
        """Take a record that is in the log: the only way in which anything here changes."""
        if record["kind"] == "push":
            self._learn(record)
        elif record["kind"] == "end":
            self._end_episode()
        elif record["kind"] == "belief":
            self._stated = record["pushes"]
        elif record["kind"] == "event":
            self.judge.take(record)
            if record["event"] in (TRAINING, TRAINED, FAILED):
                self._pending = record["event"] == TRAINING
            if self._pending:
                self._trained_at = record["pushes"]
            self._jumped = record["event"] == JUMPED or self._jumped
            if record["event"] == CHANGED:
                self._begin_anew(record["about"]["keep"], record["about"]["anchor"])

    def _begin_anew(self, keep: int, anchor: Mapping[str, float]) -> None:
        """Leave pushes out that are older than a change of the table."""
        self.believer.forget(max(keep - len(self._latest), 0), anchor)
        self._since = self._trained_at = max(self.pushes - keep, 0)

    def _learn(self, record: Mapping[str, Any]) -> None:
        result = Result.of_record(record)
        self._seen |= {result.identity, result.digest}
        self._note(result)
        self._latest.append(result)
        self._recent.append(result)
        while len(self._latest) > MOST_PUSHES:
            self._believe(self._latest.popleft())
        self.pushes += 1
        self._unnamed += not result.object
        self.judge.update(record["errors"])

    def _note(self, result: Result) -> None:
        """Take note of a push of the running episode; the belief takes those that ran out."""
        episode = result.episode or result.identity
        if episode != self._episode:
            self._end_episode()
            self._episode = episode
        self._last = result.after

    def _end_episode(self) -> None:
        while self._latest:
            self._believe(self._latest.popleft())
        self._episode, self._last = "", None

    def _believe(self, result: Result) -> None:
        (self.bodies if result.object else self.believer).add(result)

    # --- what is seen -----------------------------------------------------------------------------

    def _why_not_here(self, result: Result) -> str:
        if self._last is None or not result.episode or result.episode != self._episode:
            return ""
        if self._latest and self._latest[-1].own_bodies != result.own_bodies:
            return "its bodies are others than before in this episode"
        return _jump(self._last, result)

    def _history(self, result: Result) -> PushHistory:
        latest = list(self._latest) if result.episode == self._episode else []
        if not latest or len(latest[0].push) != len(result.push):
            return PushHistory.empty(len(result.before))
        return history_of(latest)

    def _predict(self, result: Result) -> tuple[dict[str, float], dict[str, float]]:
        """Return the errors of all contenders on a push that nothing was learned from."""
        history = self._history(result)
        errors: dict[str, float] = {}
        turns: dict[str, float] = {}
        for name in self.judge.contenders:
            try:
                contender = self._contender(name, result)
                if contender is None:
                    continue
                model = contender.with_bodies(result.own_bodies).condition(history)
                after = model.step(result.before[None], result.push[None])[0]
            except SainError:
                continue  # this one says nothing about such bodies
            if np.isfinite(after).all():
                errors[name], turns[name] = prediction_error(after, result)
        return errors, turns

    def _contender(self, name: str, result: Result | None = None) -> SainDynamics | None:
        if result is not None and result.object:
            return {PLANAR: self._planar, PHYSICS: self.bodies.model(result)}.get(name)
        if name == RECENT:
            return self.believer.recent(self._recent)
        if name == PLANAR:
            return self._planar
        if name == PHYSICS:
            return self.believer.model
        if name not in self._networks:
            keep = {one for one in self.judge.contenders if one in self._networks}
            self._networks = {one: self._networks[one] for one in keep}
            self._networks[name] = load_checkpoint(self.laboratory.model_path(name))
        return self._networks[name]

    # --- what is decided --------------------------------------------------------------------------

    def _event(self, kind: str, text: str, **about: Any) -> Event:
        return Event(kind, text, self.pushes, time.time(), about)

    def _settle(self) -> tuple[Event, ...]:
        """Decide until nothing follows any more."""
        events: list[Event] = []
        while (decision := self.judge.decide()) is not None:
            kind, text, about = decision
            if kind == CHANGED:
                about = about | {"anchor": self.believer.values}
            events.append(self._event(kind, text, **about))
            self._append(events[-1].record())
        return tuple(events)

    def _notice_jump(self) -> tuple[Event, ...]:
        """Say once that friction has jumped; the belief has counted with it already."""
        before = self.believer.jumped
        if not before or self._jumped:
            self._jumped = bool(before)
            return ()
        now = self.believer.values[FRICTION]
        text = f"friction with the table is {now:.3g}; it was {before:.3g}"
        event = self._event(JUMPED, text, before=before, now=now)
        self._append(event.record())
        return (event,)

    def _publish(self) -> None:
        """Write what others load, where it has changed."""
        named = self.bodies.update()
        changed = self.believer.update() or named
        if changed:
            belief = self.bodies.belief() if named else self.believer.belief
            write_belief(self.laboratory.belief_path, belief)
            if self.pushes > self._stated:
                values = (self.bodies if named else self.believer).parameters
                record = {"kind": "belief", "pushes": self.pushes, "parameters": values}
                self._append(record)
        service = self.judge.service
        self.laboratory.keep_models({service, self.judge.candidate})
        changed = (changed and service == PHYSICS) or service != self.laboratory.manifest.service
        self.laboratory.state(service=service, generation=self.generation + changed)

    def _train_if_due(self) -> tuple[Event, ...]:
        if self._training is not None or not self._trains or self._unnamed < FIRST_TRAINING:
            return self.poll()
        own, before = self.pushes - self._since, self._trained_at - self._since
        if not self._pending and own < max(FIRST_TRAINING, GROWTH * before):
            return ()
        event = self._event(TRAINING, f"a network is trained on {own} pushes")
        self._append(event.record())
        self._training = Training.start(self.laboratory, self._since, self.pushes)
        return (event,)

    def _finish(self, training: Training) -> tuple[Event, ...]:
        if problem := training.problem:
            event = self._event(FAILED, problem)
        elif training.since != self._since:
            event = self._event(FAILED, "the table has changed during this time")
        else:
            text = f"a network was trained on {training.pushes - training.since} pushes"
            event = self._event(TRAINED, text, model=training.service)
        self._append(event.record())
        return (event,)


def prediction_error(after: Scene, result: Result) -> tuple[float, float]:
    """Return mean errors of the bodies that were pushed or moved: places [mm], headings [degrees].

    Moved has a body that ends 2 mm or more from where it was, in truth.
    """
    moved = np.hypot(*(result.after - result.before)[:, POSITION].T) >= MOVED
    moved[pushed_bodies(result.push[None])[0]] = True
    off = after[moved] - result.after[moved]
    places = 1e3 * np.hypot(*off[:, POSITION].T)
    turns = np.degrees(np.abs(wrap_angle(off[:, THETA])))
    return float(places.mean()), float(turns.mean())


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
