"""What a push on an arm consists of: phases, events that come, and actions that follow."""

from dataclasses import dataclass
from enum import Enum, StrEnum

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_arm.planning.push_planner import PushPlan
from sain_arm.planning.timing import Trajectory
from sain_arm.robot.robot import Vector
from sain_core.errors import CancelledError
from sain_core.feasibility import Stroke
from sain_core.types import Scene


class Phase(StrEnum):
    """What the arm does; the values are those of /diagnostics."""

    STARTS = "finds out where it reaches"
    RESTS = "rests"
    WAITS = "waits"
    PLANS = "plans"
    APPROACHES = "approaches"
    PUSHES = "pushes"
    STOPS = "stops"
    RETREATS = "retreats"
    TRAVELS = "travels"


class Ended(Enum):
    """How a goal ended."""

    SUCCEEDED = "succeeded"
    REJECTED = "was rejected"  # nothing has moved
    CANCELLED = "was cancelled"
    ABORTED = "was aborted"
    LOST = "has no result"  # the controller is silent


@dataclass(frozen=True)
class Ending:
    """How a goal ended, and what the controller said."""

    how: Ended
    why: str = ""

    def __str__(self) -> str:
        """Return it in words."""
        return f"the controller's goal {self.how.value}" + (f": {self.why}" if self.why else "")


@dataclass(frozen=True, eq=False)
class ArmState:
    """The state of the arm when an event comes.

    Attributes:
        time: [s], of a steady clock.
        clock: [s], of ROS.
        joints: (J,) [rad]; None: no state is current.
        tip: (3,) [m], of the tool at these joints; None: not computed.
        stamp: of the joints' state [s], of ROS.
        changed: when a joint moved last [s], of the steady clock.
        still: whether the arm rests.
        unknown: why there are no joints.
        disabled: why the arm is not enabled; empty: it is.
        missing: why no controller takes goals; empty: one does.
        hidden: for how long [s] the arm has rested, and no scene at rest has come.
        expects: the next stroke, and the bodies (N, 8) after the latest one, if both are known.
    """

    time: float
    clock: float
    joints: Vector | None = None
    tip: Float[ndarray, "3"] | None = None
    stamp: float = -np.inf
    changed: float = -np.inf
    still: bool = False
    unknown: str = ""
    disabled: str = ""
    missing: str = ""
    hidden: float = 0.0
    expects: tuple[Stroke, Scene] | None = None

    @property
    def stopped(self) -> str:
        """Why the arm may not move; empty: it may."""
        return self.unknown or self.disabled


# --- events --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PushOrdered:
    """A push is to be carried out: it was checked."""

    stroke: Stroke


@dataclass(frozen=True)
class ReachFound:
    """The table of reach was computed."""


@dataclass(frozen=True)
class PushPlanned:
    """The plan that `PlanPush` asked for, or why there is none."""

    plan: PushPlan | BaseException


@dataclass(frozen=True)
class WayPlanned:
    """The way that `PlanAhead`, `PlanHome` or `PlanRetreat` asked for, or why there is none."""

    way: Trajectory | BaseException


@dataclass(frozen=True)
class GoalEnded:
    """The goal of `Send` has ended."""

    ending: Ending


@dataclass(frozen=True)
class SendRefused:
    """The goal of `Send` was not sent: bodies are not seen where they were."""

    error: BaseException


@dataclass(frozen=True)
class TimePassed:
    """Nothing else has happened."""


# --- actions -------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class PlanPush:
    """Plan a stroke from where the arm has joints (J,)."""

    stroke: Stroke
    joints: Vector


@dataclass(frozen=True, eq=False)
class PlanRetreat:
    """Plan the way straight up from joints (J,)."""

    joints: Vector


@dataclass(frozen=True, eq=False)
class PlanHome:
    """Plan the way above the bodies from joints (J,) to home, turned by an angle [rad]."""

    joints: Vector
    turn: float


@dataclass(frozen=True, eq=False)
class PlanAhead:
    """Plan the way from joints (J,) to near where a stroke among bodies (N, 8) would begin."""

    stroke: Stroke
    scene: Scene
    joints: Vector


@dataclass(frozen=True)
class Send:
    """Send a goal. One that `touches` leads to a body: all bodies must be seen where they were."""

    trajectory: Trajectory
    touches: bool = False


@dataclass(frozen=True)
class Cancel:
    """Have the controller stop."""

    why: str


@dataclass(frozen=True)
class Executed:
    """Answer that the push was executed; with a doubt, if a body is seen to have moved."""

    doubt: CancelledError | None = None


@dataclass(frozen=True)
class Refused:
    """Answer that no body was moved, and why."""

    error: BaseException


@dataclass(frozen=True)
class Say:
    """Log a line, as an error or a warning."""

    text: str
    is_error: bool = True


Event = (
    PushOrdered | ReachFound | PushPlanned | WayPlanned | GoalEnded | SendRefused | TimePassed
)  # fmt: skip
Action = (
    PlanPush | PlanRetreat | PlanHome | PlanAhead | Send | Cancel | Executed | Refused | Say
)  # fmt: skip
