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
3. A network is trained in a process of its own (`sain_lab.network_training`) when the pushes have
   grown by half since the last one. It becomes the candidate, and is judged on the pushes that came
   while it was trained. What errs less beyond chance, on pushes that it has not seen, goes into
   service (`sain_lab.judging.judge`).

All state is in the log: a learner that opens a laboratory reads it, goes on with a training that
was begun, and finds in `waiting` what was received and not learned from.
"""

import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import Any, Final, Self

import numpy as np

from sain_core.errors import CheckpointError, InvalidInputError, OutputError, SainError
from sain_core.output import remove
from sain_core.push import pushed_bodies
from sain_core.scene import POSITION
from sain_core.transitions import MOVED, PushHistory
from sain_core.types import Scene
from sain_lab.network_training import Training
from sain_lab.serving import load_service, model_name, on_belief
from sain_lab.state import Job, State
from sain_lab.storage import log
from sain_lab.storage.laboratory import (
    NETWORK,
    PHYSICS,
    PLANAR,
    SHIPPED,
    Laboratory,
    OpenLaboratory,
    service_of,
)
from sain_lab.storage.log import Event
from sain_lab.storage.results import Result, why_not
from sain_model.dynamics.load import load_shipped
from sain_model.dynamics.sain import SainDynamics
from sain_model.inference.kinds import write_belief


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
        model = self._models[name]
        return on_belief(model, self._state.believer.belief) if NETWORK.fullmatch(name) else model

    def error(self, name: str, result: Result, history: PushHistory) -> float | None:
        """Return the error [mm] of a contender on a push; None: it predicts none such.

        Bodies that have names are predicted by their own physics and by planar physics alone.
        Raises `SainError`: it should predict it, and does not.
        """
        model: SainDynamics | None
        if result.object and name != PLANAR:
            model = self._state.bodies.model(result) if name == PHYSICS else None
        else:
            model = self.model(name)
        return None if model is None else error_of(model, result, history)

    def forget(self, name: str) -> None:
        """Forget a network."""
        self._models.pop(name, None)


def error_of(model: SainDynamics, result: Result, history: PushHistory) -> float:
    """Return the error [mm] of a model on a push; raises `SainError`: it does not predict it."""
    conditioned = model.with_bodies(result.own_bodies).condition(history)
    after = conditioned.step(result.before[None], result.push[None])[0]
    if not np.isfinite(after).all():
        raise InvalidInputError("the prediction has NaN or Inf")
    return prediction_error(after, result)


def prediction_error(after: Scene, result: Result) -> float:
    """Return the mean error [mm] of the bodies that were pushed or moved.

    Moved has a body that ends 2 mm or more from where it was, in truth.
    """
    moved = np.hypot(*(result.after - result.before)[:, POSITION].T) >= MOVED
    moved[pushed_bodies(result.push[None])[0]] = True
    off = after[moved] - result.after[moved]
    return float((1e3 * np.hypot(*off[:, POSITION].T)).mean())


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
        self._events: list[Event] = []  # that no caller was told of
        for record in laboratory.records():
            self.state.take(record)
        self._lock = Lock()  # of what waits: it is received on another thread
        self.waiting = deque(
            one for one in laboratory.waiting() if one.identity not in self.state.seen
        )
        self._failed = False  # something that was received is left to the next learner
        self._next("")
        self._settle()
        self._drain()  # nobody waits for what was decided before

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
                self.laboratory.keep_outlines(result.own_bodies)
                self.laboratory.receive({"kind": "push", **result.record()})

    def observe(self, result: Result) -> Update:
        """Learn from a result.

        Raises `OutputError`: the disk is full; nothing was learned, and the laboratory is whole.
        """
        result = result.identified()
        try:
            self._poll()
            update = self._learn(result)
        except BaseException:
            self._failed = True
            raise
        finally:
            self._next(result.identity)
        return replace(update, events=self._drain())

    def _next(self, identity: str) -> None:
        """Let others wait no longer for a result; forget what was received once all is learned."""
        with self._lock:
            if self.waiting and self.waiting[0].identity == identity:
                self.waiting.popleft()
            if not self.waiting and not self._failed:
                self.laboratory.learned_all()

    def poll(self) -> tuple[Event, ...]:
        """Begin the training that is due, or take one that has ended; return what follows."""
        self._poll()
        return self._drain()

    def wait(self) -> tuple[Event, ...]:
        """Wait for a training under way; return what follows from it."""
        self._poll()
        if self._training is not None:
            self._training.wait()
        return self.poll()

    def _poll(self) -> None:
        job, training = self.state.training, self._training
        if job is None or (training is not None and training.running):
            return
        problem = training.problem if training else ""
        if training is None:
            try:
                self._contenders.model(job.service)
            except CheckpointError:  # it was not written whole before this learner began
                if self._trains:
                    self._training = Training.start(self.laboratory, job.pushes)
                return
        self._training = None
        self._finish(job, problem)
        self._settle()

    def _drain(self) -> tuple[Event, ...]:
        """Return the events since the last time."""
        events, self._events = tuple(self._events), []
        return events

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

    def _log(self, kind: str, text: str, **about: Any) -> None:
        event = Event(kind, text, self.state.pushes, time.time(), about)
        self._append(event.record())
        self._events.append(event)

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
            self._log(log.NOT_LEARNED, reason, **about)
            return Update(False, reason)
        errors, history = {}, self.state.history(result)
        for name in self.state.judge.contenders:
            try:
                errors[name] = self._contenders.error(name, result, history)
            except SainError as error:
                self._not_predicted(name, error)
        known = {name: error for name, error in errors.items() if error is not None}
        self.laboratory.keep_outlines(result.own_bodies)
        self._append({"kind": "push", **result.record(), "errors": known})
        self._settle()
        self._notice_jump()
        self._train_if_due()
        return Update(True, "", known)

    def _not_predicted(self, name: str, error: SainError) -> None:
        """Log why a contender did not predict, each reason once; leave a lost network out."""
        text = f"{name} did not predict a push: {error}"
        lost = isinstance(error, CheckpointError)
        if lost and name == self.state.judge.service:
            self._log(log.DROPPED, text, service=PHYSICS)
        elif lost and name == self.state.judge.candidate:
            self._log(log.LEFT_OUT, text, model=name)
        elif text not in self.state.problems:
            self._log(log.NOT_PREDICTED, text)

    # --- what follows -----------------------------------------------------------------------------

    def _settle(self) -> None:
        """Decide until nothing follows any more, and write what others load."""
        while (decision := self.state.judge.decide()) is not None:
            kind, text, about = decision
            self._log(kind, text, **about)
        self._publish()

    def _notice_jump(self) -> None:
        """Say once that parameters have jumped; the belief has counted with it already."""
        jumped, now = self.state.believer.jumped, self.state.believer.values
        if jumped and not self.state.jumped:
            texts = [f"{name} is {now[name]:.3g}; it was {jumped[name]:.3g}" for name in jumped]
            self._log(log.JUMPED, ", ".join(texts), was=jumped)
        self.state.jumped = bool(jumped)

    def _publish(self) -> None:
        """Write what others load, where it has changed; remove networks of no use any more."""
        state, service = self.state, self.state.judge.service
        named = state.bodies.update()
        changed = state.believer.update() or named
        if changed:
            belief = state.bodies.belief if named else state.believer.belief
            write_belief(self.laboratory.belief_path, belief)
            if state.pushes > state.stated:
                values = (state.bodies if named else state.believer).parameters
                self._append({"kind": "belief", "pushes": state.pushes, "parameters": values})
        changed, manifest = changed and service not in (PLANAR, SHIPPED), self.laboratory.manifest
        if changed or service != manifest.service:
            self.laboratory.state(service=service, generation=manifest.generation + 1)
        used = {service, state.judge.candidate, state.training.service if state.training else ""}
        for name in sorted(state.networks - used):
            self._contenders.forget(name)
            state.networks.discard(name)
            try:
                remove(self.laboratory.path.resolve() / name)
            except OutputError as error:
                if str(error) not in state.problems:
                    self._log(log.NOT_REMOVED, str(error), model=name)

    def _train_if_due(self) -> None:
        state = self.state
        if state.training is not None or not self._trains or state.unnamed < FIRST_TRAINING:
            return
        if state.pushes < max(FIRST_TRAINING, GROWTH * state.trained_at):
            return
        service, text = service_of(state.pushes), f"a network is trained on {state.pushes} pushes"
        self._log(log.TRAINING, text, model=service)
        try:
            self.laboratory.check_network(service)
        except OutputError as error:
            self._log(log.FAILED, str(error))
        else:
            self._poll()

    def _finish(self, job: Job, problem: str) -> None:
        """Make a trained network the candidate, judged on the pushes that came since."""
        try:
            model = None if problem else self._contenders.model(job.service)
        except CheckpointError as error:
            problem = str(error)
        if problem or model is None:
            self._log(log.FAILED, problem)
            return
        unseen: list[float | None] = []
        for result, history in self.state.unseen:
            try:
                unseen.append(None if result.object else error_of(model, result, history))
            except SainError:
                unseen.append(None)  # counted below
        failed = unseen.count(None)
        text = (
            f"a network was trained on {job.pushes} pushes, and judged on the"
            f" {len(unseen)} since" + (f", of which it does not predict {failed}" if failed else "")
        )
        self._log(log.TRAINED, text, model=job.service, unseen=unseen)
