"""What an arm does with a push, from the order to the answer: a state machine without ROS.

A push is planned and checked as a whole. Then two goals are sent. The approach touches nothing.
Before the stroke the bodies must be where they were. If the stroke is aborted, bodies may have
moved: the arm retreats, and the push counts as executed, unless tool and bodies are seen where they
were. Without the enable signal or the joints' states a goal is cancelled, and nothing more is sent.
"""

from typing import Final

import numpy as np

from sain_arm.planning import push_events as events
from sain_arm.planning.arm_config import MotionConfig
from sain_arm.planning.push_events import Action, ArmState, Ended, Ending, Event, Phase
from sain_arm.planning.push_planner import ASIDE, PushPlan
from sain_arm.planning.timing import Trajectory
from sain_arm.robot.robot import Vector
from sain_core.errors import BusyError, CancelledError
from sain_core.feasibility import Stroke
from sain_core.scene import unit

WAIT: Final = 1.0  # [s] for the enable signal, the controller or the arm, before a push is refused
FINDING: Final = 40.0  # [s] for the table of reach; a planner waits for 60
ARRIVED: Final = 0.02  # [rad], of a joint from the end of its goal
HIDES: Final = 1.0  # [s] after a stroke without a scene at rest: the arm may hide a body
LAG: Final = 0.3  # [s] by which joints, and states of them, may be behind a goal
AGAIN: Final = 0.6  # [s] of rest after a goal that failed: a planner gives up after 10 in a row


class PushExecution:
    """Carries out one push at a time: events come in, actions go out.

    What each phase makes of an event; "-": nothing, and the phase stays. Beside it, in all phases,
    a goal under way is cancelled once the arm may not move, and nothing is sent then.

    | phase | push ordered | reach found | planned | goal ended | time |
    | --- | --- | --- | --- | --- | --- |
    | starts | waits | rests | - | - | - |
    | rests | waits; ready: plans | - | - | - | next push expected, or a body hidden: travels |
    | waits | error | - | - | - | ready: plan, plans; too late: refused, rests |
    | plans | error | - | approaches; none: refused, rests | planned: approaches; else - | - |
    | approaches | error | - | - | succeeded: pushes; else refused, rests | - |
    | pushes | error | - | - | succeeded: executed, rests; rejected: refused; else stops | - |
    | stops | error | - | retreats; none: executed, rests | - | at rest or late: plan the retreat |
    | retreats | error | - | - | executed, rests | - |
    | travels | waits; ready: plans | - | sent; none: rests | rests | - |

    After a stroke, and while bodies come to rest, the arm may go on to near where the next push is
    expected to begin. A push that comes meanwhile is planned from the end of that way.

    A goal has succeeded when the controller says so and the joints are at its end. An approach that
    was to be cancelled has not. A goal that was not sent, as bodies were moved, is a push refused.
    A push without length is executed once all is ready: nothing moves.

    Attributes:
        phase: what the arm does.
    """

    def __init__(self, config: MotionConfig, clearance: float, dry_run: bool = False) -> None:
        """Begin without a push; `clearance` [m] is between a body and the tool before a stroke."""
        self.phase = Phase.STARTS
        self._config, self._clearance, self._dry_run = config, clearance, dry_run
        self._has_reach = False
        self._stroke: Stroke | None = None  # of the push that is under way
        self._plan: PushPlan | None = None
        self._since = 0.0  # when the push came, or the stroke ended [s], of the steady clock
        self._goal: Trajectory | None = None  # under way
        self._sent, self._cancelled = 0.0, ""  # when [s], and why
        self._arrives: float | None = None  # until when [s] the joints may come to its end
        self._broken_off = Ending(Ended.LOST), 0.0  # how a stroke ended too early, and when [s]
        self._rests_from = -np.inf  # when joints that rest show that a goal has ended [s], likewise
        self._retreat_asked = False
        self._doubt: CancelledError | None = None  # that the stroke has moved a body
        self._froze = -np.inf  # when joints' states lagged behind a goal [s], of the steady clock
        self._ended_at: Vector | None = None  # joints after a stroke, until the arm goes on
        self._way_failed: Ending | None = None  # of a way that a push was planned from the end of
        self._turns = list[float]()  # at home, that are left to try where the arm hides a body

    def update(self, event: Event, arm: ArmState) -> list[Action]:
        """Take an event; return what is to be done, in this order.

        Raises:
            BusyError: a push is ordered, and one is under way.
        """
        match event:
            case events.PushOrdered(stroke):
                actions = self._on_push(stroke, arm)
            case events.ReachFound():
                actions = self._on_reach()
            case events.PushPlanned(plan):
                actions = self._on_plan(plan, arm)
            case events.WayPlanned(way):
                actions = self._on_way(way, arm)
            case events.GoalEnded(ending):
                actions = self._on_goal_ended(ending, arm)
            case events.SendRefused(error):
                actions = self._on_send_refused(error)
            case events.TimePassed():
                actions = self._on_time(arm)
        return actions + self._cancel_if_stopped(arm)

    def frozen(self, changed: float) -> str:
        """Return in words that the joints' states did not follow a goal; empty: they do.

        `changed` is when a joint moved last [s], of the steady clock.
        """
        if changed >= self._froze:
            return ""
        return (
            "/joint_states did not follow the arm's last goal, and have not changed since: the"
            " arm's place is unknown; check who publishes them, then start arm_node anew"
        )

    # --- before the motion ----------------------------------------------------------------------

    def _on_push(self, stroke: Stroke, arm: ArmState) -> list[Action]:
        """Take a push; it waits a little for what it needs, so that nobody asks without end."""
        if self._stroke is not None:
            raise BusyError("a push is under way")
        self._stroke, self._since, self._doubt = stroke, arm.time, None
        self._turns, self._ended_at, self._way_failed = [], None, None
        self.phase = Phase.WAITS
        return self._try(arm)

    def _on_reach(self) -> list[Action]:
        self._has_reach = True
        if self.phase is Phase.STARTS:
            self.phase = Phase.RESTS
        return []

    def _try(self, arm: ArmState) -> list[Action]:
        """Plan the push that waits, once all is there; refuse it if that does not come."""
        missing = self._missing(arm)
        if missing:
            late = arm.time > self._since + (WAIT if self._has_reach else FINDING)
            return self._refuse(BusyError(missing)) if late else []
        assert arm.joints is not None and self._stroke is not None
        if self._stroke.length == 0.0 and not self._dry_run:
            return self._conclude()
        self.phase = Phase.PLANS
        joints = arm.joints if self._goal is None else self._goal.positions[-1]
        return [events.PlanPush(self._stroke, joints)]

    def _missing(self, arm: ArmState) -> str:
        """Return what a push waits for; empty: it can be planned."""
        if not self._has_reach:
            return "the arm's reach is being found out"
        missing = arm.missing or arm.disabled or self.frozen(arm.changed)
        if arm.unknown or (missing and not self._dry_run):
            return arm.unknown or missing
        travels = self._goal is not None and not self._cancelled
        rests = self._goal is None and arm.still and arm.time >= self._rests_from
        return "" if travels or rests else "the arm still moves"

    def _on_plan(self, plan: PushPlan | BaseException, arm: ArmState) -> list[Action]:
        if self.phase is not Phase.PLANS or self._stroke is None:
            return []
        if isinstance(plan, BaseException):
            return self._refuse(plan)
        if self._dry_run:
            text = "a dry run: the way is possible; nothing was moved"
            return self._refuse(CancelledError(text))
        self._plan = plan
        return self._try_approach(arm)

    def _try_approach(self, arm: ArmState) -> list[Action]:
        """Approach once there is a plan, and the arm is where that begins."""
        if self._plan is None or self._goal is not None:
            return []
        if self._way_failed is not None:
            return self._refuse(BusyError(f"{self._way_failed}, on the way to wait for a push"))
        self.phase = Phase.APPROACHES
        return self._send(self._plan.approach, arm, touches=True)

    # --- motion ---------------------------------------------------------------------------------

    def _send(self, goal: Trajectory, arm: ArmState, touches: bool = False) -> list[Action]:
        """Send a goal, if the arm may move."""
        if arm.stopped:
            return self._take_ending(Ending(Ended.REJECTED, arm.stopped), arm)
        self._goal, self._sent, self._cancelled = goal, arm.time, ""
        self._arrives = None
        return [events.Send(goal, touches)]

    def _cancel_if_stopped(self, arm: ArmState) -> list[Action]:
        if self._goal is None or self._cancelled or not arm.stopped:
            return []
        self._cancelled = arm.stopped
        return [events.Cancel(arm.stopped)]

    def _on_goal_ended(self, ending: Ending, arm: ArmState) -> list[Action]:
        if self._goal is None or self._arrives is not None:
            return []
        if ending.how is not Ended.REJECTED:
            self._note_frozen(self._goal, arm, arm.time - LAG)
        if ending.how is Ended.SUCCEEDED:
            self._arrives = arm.time + WAIT
            return self._try_arriving(arm)
        return self._take_ending(ending, arm)

    def _note_frozen(self, goal: Trajectory, arm: ArmState, until: float) -> None:
        """Take note of joints' states that did not follow a goal until a time [s]."""
        seen, meant = (max(time - self._sent, 0.0) for time in (arm.changed, until))
        if seen < meant:
            off = np.abs(goal.at(meant)[0] - goal.at(seen)[0]).max()
            self._froze = arm.time if off > ARRIVED else self._froze

    def _try_arriving(self, arm: ArmState) -> list[Action]:
        """Believe that a goal has succeeded once the joints say so, too."""
        if self._goal is None or self._arrives is None:
            return []
        end = self._goal.positions[-1]
        off = np.inf if arm.joints is None else _apart(arm.joints, end)
        if off <= ARRIVED:
            return self._take_ending(Ending(Ended.SUCCEEDED), arm)
        if arm.time <= self._arrives:
            return []
        self._note_frozen(self._goal, arm, self._arrives - WAIT)  # states of then have come
        text = f"called successful, but a joint is {off:.3f} rad from its end"
        return self._take_ending(Ending(Ended.ABORTED, text), arm)

    def _take_ending(self, ending: Ending, arm: ArmState) -> list[Action]:
        """Go on after a goal that has ended, or was not sent."""
        self._goal = self._arrives = None
        if ending.how is not Ended.SUCCEEDED:
            self._rests_from = arm.time + AGAIN
        elif self._cancelled and self.phase in (Phase.PLANS, Phase.APPROACHES):
            ending = Ending(Ended.CANCELLED, self._cancelled)
        match self.phase:
            case Phase.PLANS:
                self._way_failed = None if ending.how is Ended.SUCCEEDED else ending
                return self._try_approach(arm)
            case Phase.APPROACHES:
                return self._after_approach(ending, arm)
            case Phase.PUSHES:
                return self._after_stroke(ending, arm)
            case Phase.RETREATS:
                return _unless_succeeded(ending, "no retreat") + self._conclude()
            case Phase.TRAVELS:
                self.phase = Phase.RESTS
        return _unless_succeeded(ending, "the arm is not where it was to wait")

    def _after_approach(self, ending: Ending, arm: ArmState) -> list[Action]:
        """Push, unless the approach failed."""
        if ending.how is not Ended.SUCCEEDED:
            return self._refuse(_before_body(ending))
        assert self._plan is not None
        self.phase = Phase.PUSHES
        return self._send(self._plan.stroke, arm, touches=True)

    def _after_stroke(self, ending: Ending, arm: ArmState) -> list[Action]:
        if ending.how is Ended.SUCCEEDED:
            assert self._plan is not None
            self._turns, self._ended_at = list(ASIDE), self._plan.stroke.positions[-1]
            return self._conclude()
        if ending.how is Ended.REJECTED:
            return self._refuse(_untouched(ending))
        self.phase, self._since, self._retreat_asked = Phase.STOPS, arm.time, False
        self._broken_off = ending, arm.clock
        return []

    def _on_send_refused(self, error: BaseException) -> list[Action]:
        if self._goal is None or self.phase not in (Phase.APPROACHES, Phase.PUSHES):
            return []
        self._goal = None
        return self._refuse(error)

    # --- after the stroke -----------------------------------------------------------------------

    def _try_retreat(self, arm: ArmState) -> list[Action]:
        """Lift the tool once the arm rests; without the enable signal it stays where it is."""
        ending, since = self._broken_off
        late = arm.time > self._since + WAIT
        if self._retreat_asked or not (late or (arm.still and arm.stamp >= since)):
            return []
        self._retreat_asked = True
        if self._seems_untouched(arm):
            self._doubt = _untouched(ending)
        said: list[Action] = [events.Say(f"{ending}; bodies may have moved", is_error=False)]
        if arm.joints is None or (why := self.frozen(arm.changed)):
            why = arm.unknown if arm.joints is None else why
            return [*said, events.Say(f"no retreat: {why}"), *self._conclude()]
        return [*said, events.PlanRetreat(arm.joints)]

    def _seems_untouched(self, arm: ArmState) -> bool:
        """Tell whether the joints' states have the tool nearer to its start than the body was.

        A state of the joints from before the end of the goal does not tell.
        """
        _, since = self._broken_off
        if self._stroke is None or arm.tip is None or arm.stamp < since:
            return False
        heading = unit(np.asarray(self._stroke.heading))
        way = float((arm.tip[:2] - self._stroke.start) @ heading)
        low = arm.tip[2] < self._config.raised - 1e-3
        return bool(low and way < 0.5 * self._clearance)

    def _on_way(self, way: Trajectory | BaseException, arm: ArmState) -> list[Action]:
        match self.phase:
            case Phase.STOPS if isinstance(way, BaseException):
                return [events.Say(f"no retreat: {way}"), *self._conclude()]
            case Phase.TRAVELS if isinstance(way, BaseException):
                self.phase = Phase.RESTS
                if len(self._turns) == len(ASIDE):  # it was not on its way home
                    return []
                text = f"a body may be hidden by the arm, which stays: {way}"
                return [events.Say(text, is_error=False)]
            case Phase.STOPS:
                self.phase = Phase.RETREATS
            case Phase.TRAVELS if self._goal is None:
                pass
            case _:
                return []
        assert isinstance(way, Trajectory)
        return self._send(way, arm)

    def _try_home(self, arm: ArmState) -> list[Action]:
        """Go home above the bodies where none comes to rest: the arm may hide one."""
        tried = len(ASIDE) - len(self._turns)
        if not self._turns or arm.hidden < HIDES * (tried + 1):
            return []
        if self._goal is not None or not arm.still or arm.stopped or self.frozen(arm.changed):
            return []
        assert arm.joints is not None
        self.phase, self._ended_at = Phase.TRAVELS, None
        return [events.PlanHome(arm.joints, self._turns.pop(0))]

    def _try_ahead(self, arm: ArmState) -> list[Action]:
        """Go on to near the next push, as soon as bodies are seen where the stroke has led."""
        joints = self._ended_at
        moved = arm.joints is None or (joints is not None and _apart(arm.joints, joints) > ARRIVED)
        if moved or arm.stopped:  # who moves it then may leave it anywhere
            self._ended_at = joints = None
        if joints is None or arm.expects is None or self.frozen(arm.changed):
            return []
        self.phase, self._ended_at = Phase.TRAVELS, None
        return [events.PlanAhead(*arm.expects, joints)]

    def _on_time(self, arm: ArmState) -> list[Action]:
        arrived = self._try_arriving(arm)
        match self.phase:
            case Phase.WAITS:
                return arrived + self._try(arm)
            case Phase.STOPS:
                return arrived + self._try_retreat(arm)
            case Phase.RESTS:
                return arrived + (self._try_ahead(arm) or self._try_home(arm))
        return arrived

    def _conclude(self) -> list[Action]:
        """End a push that was executed."""
        self._end_push()
        return [events.Executed(self._doubt)]

    def _refuse(self, error: BaseException) -> list[Action]:
        """End a push by which no body was moved."""
        self._end_push()
        return [events.Refused(error)]

    def _end_push(self) -> None:
        self._stroke, self._plan = None, None
        self.phase = Phase.RESTS if self._goal is None else Phase.TRAVELS


def _apart(joints: Vector, others: Vector) -> float:
    """Return by how much [rad] a joint differs most."""
    return float(np.abs(joints - others).max())


def _before_body(ending: Ending) -> CancelledError:
    return CancelledError(f"{ending}; the tool had not come to the body yet")


def _untouched(ending: Ending) -> CancelledError:
    return CancelledError(f"{ending}; the tool had not touched the body yet")


def _unless_succeeded(ending: Ending, what: str) -> list[Action]:
    return [] if ending.how is Ended.SUCCEEDED else [events.Say(f"{what}: {ending}")]
