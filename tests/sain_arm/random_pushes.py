"""A node, a controller and a table of random fortune around `PushExecution`, and its laws.

1. No goal is sent without a live enable, and one under way is cancelled at once without it.
2. Each push gets one answer.
3. What moved a body is never called not made.
4. After a fault the arm rests within `REST_WITHIN`: nothing is sent for its push but a retreat.
"""

from random import Random

import numpy as np

from sain_arm.planning.arm_config import MotionConfig
from sain_arm.planning.push_events import (
    Action,
    ArmState,
    Cancel,
    Ended,
    Ending,
    Event,
    Executed,
    GoalEnded,
    Phase,
    PlanAhead,
    PlanHome,
    PlanPush,
    PlanRetreat,
    PushOrdered,
    PushPlanned,
    ReachFound,
    Refused,
    Send,
    SendRefused,
    TimePassed,
    WayPlanned,
)
from sain_arm.planning.push_execution import FINDING, WAIT, PushExecution
from sain_arm.planning.push_planner import PushPlan
from sain_arm.planning.timing import Trajectory
from sain_core.errors import BusyError, StaleSceneError, UnreachableError
from sain_core.feasibility import Stroke

CLEARANCE = 0.01
LENGTH = 0.1
REST_WITHIN, BRAKE = 0.8, 0.4  # [s], of which a controller takes so much
HOME, BESIDE, END, UP = (np.full(6, angle) for angle in (0.0, 0.5, 1.0, 1.2))
STROKE = Stroke(np.zeros(2), np.array([LENGTH, 0.0]), 0.0)
EXPECTED = STROKE, np.zeros((2, 8))  # the next stroke, and bodies
NONE = Stroke(np.zeros(2), np.zeros(2), 0.0)  # a push without length
ENDINGS = [Ending(how) for how in Ended]
SUCCEEDED, ABORTED = Ending(Ended.SUCCEEDED), Ending(Ended.ABORTED)
FAILED = UnreachableError("no way")


def way(start: np.ndarray, end: np.ndarray) -> Trajectory:
    return Trajectory(np.array([0.0, 1.0]), np.stack([start, end]), np.zeros((2, 6)))


PLAN = PushPlan(way(HOME, BESIDE), way(BESIDE, END), (0.0, 1.0))


def machine(dry_run: bool = False) -> PushExecution:
    return PushExecution(MotionConfig(), CLEARANCE, dry_run)


class Walk:
    """What may happen to an arm that pushes, and what is asserted of its machine."""

    def __init__(self, random: Random, dry_run: bool) -> None:
        self.random, self.one, self.dry_run = random, machine(dry_run), dry_run
        self.time, self.events = 0.0, 0
        self.joints, self.tip = HOME, np.array([0.0, 0.0, 0.2])
        self.enabled, self.known, self.serves, self.still = True, True, True, True
        self.changed = self.stamp = 0.0
        self.goal: Trajectory | None = None  # under way
        self.is_of_push = False  # and not the way home
        self.cancelled = False
        self.moves_until = -np.inf  # at the latest, the arm [s]
        self.failed_at: float | None = None  # when the push that is under way met a fault [s]
        self.plans = list[Action]()  # asked for, and not there yet
        self.pushes = self.answers = 0
        self.moved = False  # a body, by the push that is under way
        self.hidden_since: float | None = None
        self.expects = random.random() < 0.5

    @property
    def arm(self) -> ArmState:
        return ArmState(
            time=self.time, clock=self.time,
            joints=self.joints if self.known else None, tip=self.tip if self.known else None,
            stamp=self.stamp, changed=self.changed, still=self.still,
            unknown="" if self.known else "no /joint_states",
            disabled="" if self.enabled else "not enabled",
            missing="" if self.serves else "no controller",
            hidden=0.0 if self.hidden_since is None else self.time - self.hidden_since,
            expects=EXPECTED if self.expects else None,
        )  # fmt: skip

    def tell(self, event: Event) -> None:
        arm, sends = self.arm, 0
        fails = self.goal is not None and bool(arm.stopped)
        fails = fails or (isinstance(event, GoalEnded) and event.ending.how is not Ended.SUCCEEDED)
        if fails and self.is_of_push and self.failed_at is None:
            self.failed_at = self.time
        self.events += 1
        for action in self.one.update(event, arm):
            sends += isinstance(action, Send)
            self.do(action, arm)
        assert sends <= 1
        assert self.goal is None or self.cancelled or not arm.stopped, "a goal goes on unenabled"
        assert not fails or self.moves_until <= self.time + REST_WITHIN, "it moves after a fault"

    def do(self, action: Action, arm: ArmState) -> None:
        match action:
            case Send(goal, touches):
                assert not arm.stopped, "a goal was sent without a live enable"
                assert self.goal is None, "two goals at once"
                assert not self.dry_run, "a dry run moves nothing"
                assert touches == (goal in (PLAN.approach, PLAN.stroke))
                assert self.failed_at is None or not touches, "more than a retreat after a fault"
                self.goal, self.cancelled, self.still, self.moves_until = goal, False, False, np.inf
                self.is_of_push = self.pushes > self.answers
                if touches and self.random.random() < 0.1:
                    self.goal, self.still, self.moves_until = None, True, self.time
                    self.tell(SendRefused(StaleSceneError("a body was moved")))
            case Cancel():
                assert self.goal is not None and not self.cancelled
                self.cancelled, self.moves_until = True, self.time + BRAKE
            case PlanPush() | PlanHome() | PlanAhead() | PlanRetreat():
                assert arm.joints is not None
                self.plans.append(action)
            case Executed(doubt):
                assert doubt is None or not self.moved, "what moved a body is in doubt"
                self.answer()
                self.hidden_since = self.time
            case Refused():
                assert not self.moved, "what moved a body was called not made"
                self.answer()

    def answer(self) -> None:
        self.answers += 1
        assert self.answers == self.pushes, "each push has one answer"
        self.moved, self.failed_at = False, None

    # --- what may happen ------------------------------------------------------------------------

    def pass_time(self) -> None:
        self.time += self.random.choice([0.02, 0.1, 0.5, 2.0])
        if self.random.random() < 0.5:
            self.stamp = self.time
        self.still = self.still or (self.goal is None and self.random.random() < 0.5)
        if self.random.random() < 0.5:
            self.enabled = self.known = self.serves = True
        self.tell(TimePassed())

    def change(self) -> None:
        name = self.random.choice(["enabled", "known", "serves"])
        setattr(self, name, not getattr(self, name))
        self.tell(TimePassed())

    def order(self) -> None:
        if self.pushes > self.answers:
            try:
                self.one.update(PushOrdered(STROKE), self.arm)
            except BusyError:
                return
            raise AssertionError("two pushes at once")
        self.pushes += 1
        self.hidden_since = None
        self.tell(PushOrdered(NONE if self.random.random() < 0.1 else STROKE))
        self.is_of_push = self.is_of_push or self.one.phase is Phase.PLANS

    def plan(self) -> None:
        if not self.plans:
            return
        asked = self.plans.pop(0)
        fails = self.random.random() < 0.2
        if isinstance(asked, PlanPush):
            self.tell(PushPlanned(FAILED if fails else PLAN))
        else:
            self.tell(WayPlanned(FAILED if fails else way(self.joints, UP)))

    def end(self, how: Ending | None = None) -> None:
        if self.goal is None:
            return
        luck = SUCCEEDED if self.random.random() < 0.6 else self.random.choice(ENDINGS)
        goal, ending = self.goal, how or luck
        share = 1.0 if ending.how is Ended.SUCCEEDED else self.random.random()
        self.goal, self.still = None, self.random.random() < 0.5
        self.moves_until = min(self.moves_until, self.time + BRAKE)
        if ending.how is not Ended.REJECTED:
            self.joints = goal.positions[0] + share * (goal.positions[-1] - goal.positions[0])
            if goal is PLAN.stroke:
                self.tip = np.array([share * LENGTH, 0.0, MotionConfig().tip_height])
                self.moved = share * LENGTH > CLEARANCE
            else:
                self.tip = np.array([0.0, 0.0, 0.2])
            self.changed = self.time
        self.tell(GoalEnded(ending))

    def find_reach(self) -> None:
        self.tell(ReachFound())

    def conclude(self) -> None:
        """End all goals: no push is left without an answer."""
        for _ in range(4):
            self.plan()
            self.end(ABORTED)
            self.time, self.still = self.time + FINDING + WAIT, True
            self.tell(TimePassed())
        assert self.answers == self.pushes, "each push has one answer"
        assert self.one.phase in (Phase.STARTS, Phase.RESTS, Phase.TRAVELS)


STEPS = (
    Walk.pass_time, Walk.pass_time, Walk.change, Walk.order, Walk.plan, Walk.end, Walk.end,
    Walk.find_reach,
)  # fmt: skip


def walk(events: int, dry_run: bool = False, steps: int = 60) -> tuple[int, int, int]:
    """Walk at random with so many events; return how many there were, of them pushes and walks."""
    seed = done = pushes = 0
    while done < events:
        random = Random(seed)
        one = Walk(random, dry_run)
        if seed % 4:
            one.find_reach()
        for _ in range(steps):
            random.choice(STEPS)(one)
        one.conclude()
        seed, done, pushes = seed + 1, done + one.events, pushes + one.pushes
    return done, pushes, seed
