"""Runs an agent: events go in from the executor, its actions are done, its work on a thread."""

from concurrent.futures import Future
from functools import partial
from typing import Any

from rclpy.node import Node

from sain_core.guarding.ros.reception import Reception, outcome
from sain_core.ros.worker import Worker
from sain_mppi.agent.agent import Agent
from sain_mppi.agent.events import (
    Action,
    Completed,
    Computation,
    Event,
    GoalCancelled,
    PushDecision,
    Stop,
)
from sain_mppi.ros.plans import Plans
from sain_mppi.ros.watch import PeerWatch


class Driver:
    """Hands events to an agent and does what it wants, on the executor's thread."""

    def __init__(
        self, node: Node, agent: Agent, plans: Plans, reception: Reception, watch: PeerWatch
    ) -> None:
        """Publish decisions by `plans`. Actions wait until the watch is `ready`."""
        self._agent, self._plans, self._reception, self._watch = agent, plans, reception, watch
        self._worker = Worker(node, "planning")
        self._waiting: tuple[Action, ...] = ()

    def update(self, event: Event) -> None:
        """Take an event; an agent that fails unexpectedly loses its goal."""
        done = outcome(partial(self._agent.update, event))
        error = self._defect(done)
        self._act(done.result() if error is None else self._agent.update(GoalCancelled(error)))

    def _act(self, actions: tuple[Action, ...]) -> None:
        self._waiting += actions
        if not self._watch.ready:
            return
        actions, self._waiting = self._waiting, ()
        for action in actions:
            match action:
                case PushDecision():
                    self._plans.send(action, self._agent.pushes)
                case Stop():
                    self._plans.stop(action, self._agent.pushes)
                case Computation():
                    self._worker.submit(action.run, partial(self._on_done, action))

    def _on_done(self, work: Computation, done: "Future[Event]") -> None:
        error = self._defect(done)
        event = done.result() if error is None else work.failed(error)
        if isinstance(event, Completed):
            self._plans.show(event.decision, self._agent.pushes)
        self.update(event)

    def _defect(self, done: "Future[Any]") -> BaseException | None:
        """Return the error of what never should fail, and leave a trace of it."""
        error = done.exception()
        if error is not None:
            self._reception.log_defect(error)
        return error

    def cancel(self) -> None:
        """Plan no more."""
        self._agent.update(GoalCancelled())

    def close(self) -> None:
        """Wait for the work that is under way."""
        self._worker.close()
