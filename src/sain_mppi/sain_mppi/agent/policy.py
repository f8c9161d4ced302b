"""A policy of others in the planner's seat: asked for each push, and refused what is none."""

import logging
from collections.abc import Callable, Mapping
from concurrent.futures import Future, wait
from queue import SimpleQueue
from threading import Event, Thread
from time import monotonic
from typing import Any, Final
from weakref import finalize

import numpy as np

from sain_core.config import MOST_SEED
from sain_core.errors import CancelledError, ModelUnavailableError, NoPushError, SainError
from sain_core.policy import Policy, See, check_features, no_camera, observe
from sain_core.push import push_of
from sain_core.types import PushArray
from sain_mppi.agent.agent import AgentConfig
from sain_mppi.agent.events import PlanJob, PushDecision
from sain_mppi.agent.planning import Decider

logger = logging.getLogger(__name__)

LOOK: Final = 0.02  # [s] between looks whether an answer is still wanted

Waiting = tuple[Callable[[], Any], Future[Any]]  # work, and where its result goes


class PolicyDecider(Decider):
    """Asks a policy for each push. What it refuses is counted, and moves nothing.

    An answer is refused that comes late, raises, or is no push in the limits. Then the policy is
    asked again, up to `max_refusals` times from one scene, of which the arm's refusals are part.

    Attributes:
        refused: answers so far.
        refusal: why the last of them was refused; empty: none was.
        trouble: as `Decider` has it.
    """

    def __init__(
        self,
        policy: Policy,
        name: str,
        config: AgentConfig,
        call: "TimedCall | None" = None,
        see: See = no_camera,
    ) -> None:
        """Ask a policy; who shares it shares the `call`, too: it is asked one at a time.

        `see` returns what cameras see.
        """
        self._policy, self._name, self._config, self._see = policy, name, config, see
        self._session: int | None = None
        self._call = call or TimedCall()
        self.refused, self.refusal, self.trouble = 0, "", ""

    @property
    def figures(self) -> Mapping[str, object]:
        """What diagnostics show."""
        return {"policy": self._name, "policy_refused": self.refused, "refusal": self.refusal}

    def decide(self, job: PlanJob, generator: np.random.Generator) -> PushDecision:
        """Ask the policy until its answer is a push.

        Raises `CancelledError`: the job was cancelled; `NoPushError`: too many answers were
        refused; `ConfigError`: the policy takes other scenes.
        """
        check_features(self._name, self._policy.features, len(job.problem.scene))
        left = self._config.max_refusals - len(job.problem.refused)
        for refused in range(left):
            try:
                push = self._ask(job, generator)
            except CancelledError:
                raise
            except SainError as error:
                self.refusal = self.trouble = f"policy {self._name}: {error}"
                self.refused += 1
                logger.warning("an answer is refused: %s", self.trouble)
            else:
                self.trouble = ""
                concern = f"{refused} answers were refused, the last: {self.refusal}"
                return PushDecision(job, push, warning=concern if refused else "")
        self.trouble = ""
        raise NoPushError(f"{left} answers in a row were refused, the last: {self.refusal}")

    def _ask(self, job: PlanJob, generator: np.random.Generator) -> PushArray:
        problem, policy = job.problem, self._policy

        def answer() -> object:
            known = problem.scene, problem.goal, problem.bodies, policy.features
            seen = observe(*known, self._see, job.observed.time)
            if job.session != self._session:
                policy.reset(int(generator.integers(MOST_SEED)))
                self._session = job.session
            return policy.select_action(seen)

        try:
            action = self._call(answer, self._config.policy_timeout, job.cancelled)
        except SainError:
            raise
        except Exception as error:
            raise ModelUnavailableError(f"it raised {type(error).__name__}: {error}") from error
        bodies, limits = problem.bodies, problem.feasibility.limits
        last = 0 if bodies.pushable == (0,) else len(bodies) - 1
        return limits.check(push_of(action, last, limits), bodies)


class TimedCall:
    """Calls what may never return, all in one thread, which does not outlive the process."""

    def __init__(self) -> None:
        self._waiting = SimpleQueue[Waiting | None]()
        self._last: Future[Any] | None = None

    def __call__(self, work: Callable[[], Any], timeout_s: float, cancelled: Event) -> Any:
        """Return what work returns in time; what was late before has to end first.

        Raises `ModelUnavailableError`: it is late; `CancelledError`: the answer is not wanted.
        """
        end = monotonic() + timeout_s

        def done(future: "Future[Any]") -> "Future[Any]":
            while not wait([future], max(min(LOOK, end - monotonic()), 0.0)).done:
                if cancelled.is_set():
                    raise CancelledError("the answer is no longer wanted")
                if monotonic() >= end:
                    raise ModelUnavailableError(f"it did not answer within {timeout_s:.3g} s")
            return future

        if self._last is None:
            Thread(target=_work, args=(self._waiting,), name="policy", daemon=True).start()
            finalize(self, self._waiting.put, None)
        else:
            done(self._last)
        self._last = future = Future[Any]()
        self._waiting.put((work, future))
        return done(future).result()


def _work(waiting: "SimpleQueue[Waiting | None]") -> None:
    """Work until None comes."""
    while (one := waiting.get()) is not None:
        work, future = one
        try:
            future.set_result(work())
        except BaseException as error:  # noqa: BLE001 - it is raised by whoever asks
            ends = not isinstance(error, Exception)  # a policy ends no process that asks it
            text = f"it raised {type(error).__name__}: {error}"
            future.set_exception(ModelUnavailableError(text) if ends else error)
        del one, work, future  # they hold whoever asked
