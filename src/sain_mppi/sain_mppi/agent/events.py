"""What happens to an agent, and what it wants done: `Agent.update` turns one into the other."""

from collections.abc import Callable
from dataclasses import dataclass

from sain_core.errors import CancelledError
from sain_core.shapes.bodies import Bodies
from sain_core.types import PushArray, Scene
from sain_mppi.agent.decision import PushDecision, Stop, Task


@dataclass(frozen=True, eq=False)
class EpisodeBegun:
    """An episode has these bodies. Without this event, all are disks.

    If it comes again for the same episode, then whoever executes pushes began anew at a time [s],
    and the push under way has no result.
    """

    episode_id: int
    bodies: Bodies
    time: float = 0.0


@dataclass(frozen=True, eq=False)
class SceneSeen:
    """A scene (N, 8), with the ids by which a push names it.

    `time` is that of the observation [s], by the clock of the results.
    """

    scene: Scene
    episode_id: int
    scene_id: int
    settled: bool = True
    time: float = 0.0


@dataclass(frozen=True, eq=False)
class PushExecuted:
    """A push (5,), whoever sent it, led from one scene (N, 8) to another, until a time [s]."""

    push_id: int
    episode_id: int
    before: Scene
    push: PushArray
    after: Scene
    time: float = 0.0


@dataclass(frozen=True)
class PushEnded:
    """A push, whoever sent it, ended with a code of `sain_core.errors.ErrorCode`.

    It was refused. Or it was executed (OK), and nothing is known of where it led.
    """

    push_id: int
    code: int
    time: float = 0.0


@dataclass(frozen=True, eq=False)
class GoalGiven:
    """A goal replaces the one before. `pushes` were sent for it already."""

    task: Task
    pushes: int = 0


@dataclass(frozen=True, eq=False)
class GoalCancelled:
    """No goal is to be followed any more. A push under way is executed to its end."""

    error: BaseException = CancelledError("the goal was cancelled")


@dataclass(frozen=True)
class TimePassed:
    """Time passed, by the agent's own clock: what was waited for may not come any more."""


@dataclass(frozen=True, eq=False)
class Decided:
    """The work on a job has ended. No outcome: it was cancelled."""

    outcome: PushDecision | Stop | None


@dataclass(frozen=True, eq=False)
class Completed:
    """A decision whose push is sent, with what the push need not wait for."""

    decision: PushDecision


@dataclass(frozen=True)
class Prepared:
    """The work ahead, while a push is executed, has ended."""


Event = (
    EpisodeBegun
    | SceneSeen
    | PushExecuted
    | PushEnded
    | GoalGiven
    | GoalCancelled
    | TimePassed
    | Decided
    | Completed
    | Prepared
)


@dataclass(frozen=True, eq=False)
class Computation:
    """What takes long. Its event goes back to `Agent.update`.

    An agent's computations run in the order in which it asks for them, on any one thread.

    Attributes:
        run: compute, and return the event.
        failed: return the event that replaces it, if `run` raised what it never should.
    """

    run: Callable[[], Event]
    failed: Callable[[BaseException], Event]


Action = PushDecision | Stop | Computation
"""Send a push; tell that no push follows, and why; compute. No action: wait for an event."""
