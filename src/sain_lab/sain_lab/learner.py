"""The learner: results in, and out come the belief, networks and decisions of a laboratory.

    with Learner.named("my_table") as learner:          # or a path; locked by this process
        update = learner.observe(Result(push, before, after, bodies=bodies, episode="run 7/12"))
        update.learned, update.reason                    # False: why nothing was learned from it
        update.errors                                    # {"planar": 1.7, "physics": 1.2, ...} [mm]
        update.events                                    # what was decided: Event(kind, text, ...)
        learner.poll()                                   # a training that ended: more events
        learner.laboratory.manifest.generation           # changes when others should load again:
        learner.model, learner.model_name                # a model; "lab:PATH" for `load_model`

1. A push is predicted by all contenders before anything is learned from it, with the episode's
   earlier pushes as in deployment: `planar`, `physics` (as believed), `shipped`, the network in
   service, and a candidate. The push and its errors are one record of the log.
2. The state takes the record (`sain_lab.state`): beliefs and bets change.
3. A network is trained in a process of its own (`sain_lab.training`) when the pushes have grown by
   half since the last one. It becomes the candidate, and is judged on the pushes that came while it
   was trained. It goes into service when it errs less beyond chance on pushes that it has not
   seen, and out when it errs more (`sain_lab.judging.sequential_test`).

All state is in the log: a learner that opens a laboratory reads it, goes on with a training that
was begun, and finds in `waiting` what was received and not learned from.
"""

import time
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import Any, Final, Self

import numpy as np

from sain_core.errors import CheckpointError, InvalidInputError, OutputError, SainError
from sain_core.output import remove
from sain_core.push import pushed_bodies
from sain_core.scene import POSITION, THETA, wrap_angle
from sain_core.transitions import MOVED, PushHistory
from sain_core.types import Scene
from sain_lab.judging.judge import RECENT
from sain_lab.serving import load_service, model_name
from sain_lab.state import Job, State
from sain_lab.storage import log
from sain_lab.storage.laboratory import (
    PHYSICS,
    PLANAR,
    SHIPPED,
    Laboratory,
    OpenLaboratory,
    service_of,
)
from sain_lab.storage.log import Event
from sain_lab.storage.results import Result, why_not
from sain_lab.training import Training
from sain_model.dynamics.load import load_shipped
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.kinds import FRICTION, write_belief

Errors = tuple[float, float]  # of places [mm] and of headings [degrees]


class Contenders:
    """The physics as it is believed, what it is compared with, and the laboratory's networks."""

    def __init__(self, laboratory: Laboratory, shipped: SainDynamics, state: State) -> None:
        self._laboratory, self._state = laboratory, state
        self._models = {SHIPPED: shipped}

    def model(self, name: str) -> SainDynamics:
        """Return a contender for an episode that begins; raises `CheckpointError`."""
        if name == PHYSICS:
            return self._state.believer.model
        if name not in self._models:
            self._models[name] = load_service(self._laboratory, name)
        return self._models[name]

    def errors(self, name: str, result: Result, history: PushHistory) -> Errors | None:
        """Return the errors of a contender on a push; None: it predicts none such.

        Bodies that have names are predicted by their own physics and by planar physics alone.
        Raises `SainError`: it should predict it, and does not.
        """
        model: SainDynamics | None
        if result.object and name != PLANAR:
            model = self._state.bodies.model(result) if name == PHYSICS else None
        elif name == RECENT:
            model = self._state.believer.recent(self._state.recent)
        else:
            model = self.model(name)
        return None if model is None else error_of(model, result, history)

    def has_network(self, name: str) -> bool:
        """Return True if a network was written whole."""
        try:
            self.model(name)
        except CheckpointError:
            return False
        return True

    def forget(self, name: str) -> None:
        """Forget a network."""
        self._models.pop(name, None)


def error_of(model: SainDynamics, result: Result, history: PushHistory) -> Errors:
    """Return the errors of a model on a push; raises `SainError`: it does not predict it."""
    conditioned = model.with_bodies(result.own_bodies).condition(history)
    after = conditioned.step(result.before[None], result.push[None])[0]
    if not np.isfinite(after).all():
        raise InvalidInputError("the prediction has NaN or Inf")
    return prediction_error(after, result)


def prediction_error(after: Scene, result: Result) -> Errors:
    """Return the mean errors of the bodies that were pushed or moved.

    Moved has a body that ends 2 mm or more from where it was, in truth.
    """
    moved = np.hypot(*(result.after - result.before)[:, POSITION].T) >= MOVED
    moved[pushed_bodies(result.push[None])[0]] = True
    off = after[moved] - result.after[moved]
    places = 1e3 * np.hypot(*off[:, POSITION].T)
    turns = np.degrees(np.abs(wrap_angle(off[:, THETA])))
    return float(places.mean()), float(turns.mean())


# --- the learner ----------------------------------------------------------------------------------

FIRST_TRAINING: Final = 50  # pushes
GROWTH: Final = 1.5  # of the number of pushes from one training to the next


@dataclass(frozen=True)
class Update:
    """What became of a result."""

    learned: bool  # whether it was learned from
    reason: str = ""  # why not; empty: it was
    # mean error of bodies that moved [mm], by contender
    errors: Mapping[str, float] = field(default_factory=dict)
    turns: Mapping[str, float] = field(default_factory=dict)  # likewise of headings [degrees]
    events: tuple[Event, ...] = ()  # what was decided


class Learner:
    """Learns in one laboratory. Pure Python; a call returns within seconds.

    Attributes:
        laboratory: where all of it is kept.
        state: what follows from its log: beliefs and bets.
        waiting: results that were received, in order, and not observed yet.
    """

    def __init__(self, laboratory: OpenLaboratory, trains: bool = True) -> None:
        """Go on where the log ends; the laboratory is closed with the learner.

        Raises `DatasetError` or `CheckpointError`: the laboratory is damaged.
        """
        self.laboratory, self._trains = laboratory, trains
        shipped = load_shipped()
        self.state = State(shipped)
        self._contenders = Contenders(laboratory, shipped, self.state)
        self._training: Training | None = None
        for record in laboratory.records():
            self.state.take(record)
        self._lock = Lock()  # of what waits: it is received on another thread
        self.waiting = deque(
            one for one in laboratory.waiting() if one.identity not in self.state.seen
        )
        self._failed = False  # something that was received is left to the next learner
        self._next("")
        self._settle()

    @classmethod
    def named(cls, name: str, trains: bool = True) -> Self:
        """Return the learner of a laboratory by name or path; it is made where there is none."""
        return cls(OpenLaboratory.named(name), trains)

    @property
    def model(self) -> SainDynamics:
        """What is in service, for an episode that begins; see `sain_core.model.Model`."""
        return self._contenders.model(self.state.judge.service)

    @property
    def model_name(self) -> str:
        """The name by which another process loads what is in service."""
        return model_name(self.laboratory.path)

    def receive(self, result: Result) -> None:
        """Keep a result, over a kill too, until `observe` has it; on any thread.

        Raises `OutputError`: the disk is full; the result waits in memory.
        """
        result = result.identified()
        with self._lock:
            self.waiting.append(result)
            if not why_not(result):
                self.laboratory.receive({"kind": "push", **result.record()})

    def observe(self, result: Result) -> Update:
        """Learn from a result.

        Raises `OutputError`: the disk is full; nothing was learned, and the laboratory is whole.
        """
        result = result.identified()
        try:
            ended = self.poll()
            update = self._learn(result)
        except BaseException:
            self._failed = True
            raise
        finally:
            self._next(result.identity)
        return replace(update, events=(*ended, *update.events))

    def _next(self, identity: str) -> None:
        """Let others wait no longer for a result; forget what was received once all is learned."""
        with self._lock:
            if self.waiting and self.waiting[0].identity == identity:
                self.waiting.popleft()
            if not self.waiting and not self._failed:
                self.laboratory.learned_all()

    def poll(self) -> tuple[Event, ...]:
        """Begin the training that is due, or take one that has ended; return what follows."""
        job = self.state.training
        if job is None or (self._training is not None and self._training.running):
            return ()
        if self._training is None and not self._contenders.has_network(job.service):
            if self._trains:
                self._training = Training.start(self.laboratory, job.since, job.pushes)
            return ()
        problem = self._training.problem if self._training else ""
        self._training = None
        return (self._finish(job, problem), *self._settle())

    def wait(self) -> tuple[Event, ...]:
        """Wait for a training under way; return what follows from it."""
        begun = self.poll()
        if self._training is not None:
            self._training.wait()
        return (*begun, *self.poll())

    def end_episode(self) -> None:
        """Let the belief take all pushes: nothing conditions on the running episode any more."""
        if self.state.conditions:
            self._append({"kind": "end"})
        self._publish()

    def close(self) -> None:
        """Stop a training, and let another process have the laboratory."""
        if self._training is not None:
            self._training.stop()
        self.laboratory.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _append(self, record: dict[str, Any]) -> None:
        self.laboratory.append(record)
        self.state.take(record)

    def _log(self, kind: str, text: str, **about: Any) -> Event:
        event = Event(kind, text, self.state.pushes, time.time(), about)
        self._append(event.record())
        return event

    # --- one result -------------------------------------------------------------------------------

    def _learn(self, result: Result) -> Update:
        for name in (result.identity, result.digest):
            if reason := self.state.seen.get(name):
                return Update(False, reason)
        about: dict[str, Any] = {"id": result.identity}
        reason = why_not(result)
        if not reason and (reason := self.state.why_not(result)):
            about |= {"episode": result.episode, "after": result.after.tolist()}
        if reason:
            return Update(False, reason, events=(self._log(log.NOT_LEARNED, reason, **about),))
        errors, turns, problems = self._predict(result)
        self._append({"kind": "push", **result.record(), "errors": errors, "turns": turns})
        decided = (*problems, *self._settle(), *self._notice_jump())
        return Update(True, "", errors, turns, (*decided, *self._train_if_due()))

    def _predict(
        self, result: Result
    ) -> tuple[dict[str, float], dict[str, float], tuple[Event, ...]]:
        """Return the errors of all contenders on a push that nothing was learned from."""
        history = self.state.history(result)
        errors: dict[str, float] = {}
        turns: dict[str, float] = {}
        problems: list[Event] = []
        for name in self.state.judge.contenders:
            try:
                if (found := self._contenders.errors(name, result, history)) is not None:
                    errors[name], turns[name] = found
            except SainError as error:
                problems += self._not_predicted(name, error)
        return errors, turns, tuple(problems)

    def _not_predicted(self, name: str, error: SainError) -> Iterator[Event]:
        """Log why a contender did not predict, each reason once; leave a lost network out."""
        text = f"{name} did not predict a push: {error}"
        lost = isinstance(error, CheckpointError)
        if lost and name == self.state.judge.service:
            yield self._log(log.DROPPED, text, service=PHYSICS)
        elif lost and name == self.state.judge.candidate:
            yield self._log(log.LEFT_OUT, text, model=name)
        elif text not in self.state.problems:
            yield self._log(log.NOT_PREDICTED, text)

    # --- what follows -----------------------------------------------------------------------------

    def _settle(self) -> tuple[Event, ...]:
        """Decide until nothing follows any more, and write what others load."""
        found: list[Event] = []
        while (decision := self.state.judge.decide()) is not None:
            kind, text, about = decision
            if kind == log.CHANGED:
                about = about | {"anchor": self.state.believer.values}
            found.append(self._log(kind, text, **about))
        return (*found, *self._publish())

    def _notice_jump(self) -> tuple[Event, ...]:
        """Say once that friction has jumped; the belief has counted with it already."""
        before = self.state.believer.jumped
        if not before or self.state.jumped:
            self.state.jumped = bool(before)
            return ()
        now = self.state.believer.values[FRICTION]
        text = f"friction with the table is {now:.3g}; it was {before:.3g}"
        return (self._log(log.JUMPED, text, before=before, now=now),)

    def _publish(self) -> tuple[Event, ...]:
        """Write what others load, where it has changed; remove networks of no use any more."""
        state, service = self.state, self.state.judge.service
        named = state.bodies.update()
        changed = state.believer.update() or named
        if changed:
            belief = state.bodies.belief() if named else state.believer.belief
            write_belief(self.laboratory.belief_path, belief)
            if state.pushes > state.stated:
                values = (state.bodies if named else state.believer).parameters
                self._append({"kind": "belief", "pushes": state.pushes, "parameters": values})
        changed, manifest = changed and service == PHYSICS, self.laboratory.manifest
        if changed or service != manifest.service:
            self.laboratory.state(service=service, generation=manifest.generation + 1)
        return self._remove_networks()

    def _remove_networks(self) -> tuple[Event, ...]:
        """Remove networks that are neither in service nor to be judged."""
        used = {self.state.judge.service, self.state.judge.candidate}
        used |= {self.state.training.service} if self.state.training else set()
        found = []
        for name in sorted(self.state.networks - used):
            self._contenders.forget(name)
            self.state.networks.discard(name)
            try:
                remove(self.laboratory.path.resolve() / name)
            except OutputError as error:
                if str(error) not in self.state.problems:
                    found.append(self._log(log.NOT_REMOVED, str(error), model=name))
        return tuple(found)

    def _train_if_due(self) -> tuple[Event, ...]:
        state = self.state
        if state.training is not None or not self._trains or state.unnamed < FIRST_TRAINING:
            return ()
        own, before = state.pushes - state.since, state.trained_at - state.since
        if own < max(FIRST_TRAINING, GROWTH * before):
            return ()
        service, text = service_of(state.pushes), f"a network is trained on {own} pushes"
        begun = self._log(log.TRAINING, text, model=service, since=state.since)
        try:
            self.laboratory.check_network(service)
        except OutputError as error:
            return begun, self._log(log.FAILED, str(error))
        return (begun, *self.poll())

    def _finish(self, job: Job, problem: str) -> Event:
        """Make a trained network the candidate, judged on the pushes that came since."""
        if not problem and job.since != self.state.since:
            problem = "the table has changed during this time"
        if problem:
            return self._log(log.FAILED, problem)
        try:
            model = self._contenders.model(job.service)
        except CheckpointError as error:
            return self._log(log.FAILED, str(error))
        unseen = [self._unseen_error(model, *one) for one in self.state.unseen]
        failed = unseen.count(None)
        text = (
            f"a network was trained on {job.pushes - job.since} pushes, and judged on the"
            f" {len(unseen)} since" + (f", of which it does not predict {failed}" if failed else "")
        )
        return self._log(log.TRAINED, text, model=job.service, unseen=unseen)

    @staticmethod
    def _unseen_error(model: SainDynamics, result: Result, history: PushHistory) -> float | None:
        try:
            return None if result.object else error_of(model, result, history)[0]
        except SainError:
            return None  # counted in the event
