"""The state machine of a push: every event in every phase, and laws on random walks."""

import re
from copy import deepcopy
from dataclasses import replace
from random import Random

import numpy as np
import pytest

from sain_arm.planning.arm_config import MotionConfig
from sain_arm.planning.push_events import (
    ArmState,
    Cancel,
    Ended,
    Ending,
    Executed,
    GoalEnded,
    Phase,
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
from sain_arm.planning.push_execution import FINDING, HIDES, WAIT, PushExecution
from sain_arm.planning.push_planner import PushPlan
from sain_arm.planning.timing import Trajectory
from sain_core.errors import BusyError, CancelledError, StaleSceneError, UnreachableError
from sain_core.feasibility import Stroke

CLEARANCE = 0.01
LENGTH = 0.1
HOME, BESIDE, END, UP = (np.full(6, angle) for angle in (0.0, 0.5, 1.0, 1.2))
STROKE = Stroke(np.zeros(2), np.array([LENGTH, 0.0]), 0.0)
NONE = Stroke(np.zeros(2), np.zeros(2), 0.0)  # a push without length


def way(start, end):
    return Trajectory(np.array([0.0, 1.0]), np.stack([start, end]), np.zeros((2, 6)))


PLAN = PushPlan(way(HOME, BESIDE), way(BESIDE, END), (0.0, 1.0))
FAILED = UnreachableError("no way")
REST = ArmState(time=0.0, clock=0.0, joints=HOME, stamp=0.0, changed=0.0, still=True)
ENDINGS = [Ending(how) for how in Ended]
SUCCEEDED, ABORTED = Ending(Ended.SUCCEEDED), Ending(Ended.ABORTED)


def machine(dry_run=False):
    return PushExecution(MotionConfig(), CLEARANCE, dry_run)


def at(joints=HOME, time=0.0, **more):
    return replace(REST, time=time, clock=time, stamp=time, changed=time, joints=joints, **more)


def in_phase(phase):
    """Return machines that were brought to a phase, from a push before on."""
    one = machine()
    if phase is Phase.STARTS:
        return [one]
    one.update(ReachFound(), at())
    steps = [
        (PushOrdered(STROKE), at(disabled="not enabled")),  # waits
        (TimePassed(), at()),
        (PushPlanned(PLAN), at()),
        (GoalEnded(SUCCEEDED), at(BESIDE)),  # pushes
        (GoalEnded(ABORTED), at(END)),
        (TimePassed(), at(END)),
        (WayPlanned(way(END, UP)), at(END)),
    ]
    if phase in (Phase.RESTS, Phase.GOES_HOME):
        steps[4:] = [(GoalEnded(SUCCEEDED), at(END)), (TimePassed(), at(END, hidden=HIDES))]
    for event, arm in steps:
        one.update(event, arm)
        if one.phase is phase:
            break
    assert one.phase is phase
    if phase is not Phase.GOES_HOME:
        return [one]
    sent = deepcopy(one)
    sent.update(WayPlanned(way(END, HOME)), at(END))
    return [one, sent]


EVENTS = {
    "push ordered": [PushOrdered(STROKE)],
    "reach found": [ReachFound()],
    "planned": [
        PushPlanned(PLAN), PushPlanned(FAILED), WayPlanned(way(END, UP)), WayPlanned(FAILED),
    ],
    "goal ended": [GoalEnded(ending) for ending in ENDINGS],
    "time": [TimePassed()],
}  # fmt: skip
STATES = {
    "rest": at,
    "late": lambda joints: at(joints, time=100.0),
    "hidden": lambda joints: at(joints, time=100.0, hidden=3 * HIDES),
    "late, disabled": lambda joints: at(joints, time=100.0, disabled="not enabled"),
    "disabled": lambda joints: at(joints, disabled="not enabled"),
    "unknown": lambda joints: replace(at(None), unknown="no /joint_states"),
}


def table():
    """Return the cells of the table in the docstring, by phase and event."""
    rows = [line for line in PushExecution.__doc__.splitlines() if line.strip().startswith("|")]
    head, _, *rest = [[cell.strip() for cell in row.strip(" |").split("|")] for row in rows]
    return {
        (phase, name): cell
        for phase, *cells in rest
        for name, cell in zip(head[1:], cells, strict=True)
    }


PHASE_OF = {phase.name.lower().replace("_", " "): phase for phase in Phase}


@pytest.mark.parametrize("name", EVENTS)
@pytest.mark.parametrize("phase", Phase)
def test_every_event_in_every_phase_does_what_the_table_states(phase, name):
    cell = table()[phase.name.lower().replace("_", " "), name]
    # A goal that may not be sent has ended at once, and the push with it.
    allowed = {phase, *(PHASE_OF[word] for word in PHASE_OF if re.search(rf"\b{word}\b", cell))}
    reached = set()
    for event in EVENTS[name]:
        for joints in (HOME, BESIDE, END):
            for state in STATES.values():
                for one in in_phase(phase):
                    if cell == "error":
                        with pytest.raises(BusyError, match="a push is under way"):
                            one.update(event, state(joints))
                        continue
                    actions = one.update(event, state(joints))
                    reached.add(one.phase)
                    ended = any(isinstance(a, Refused | Executed) for a in actions)
                    assert one.phase in allowed or (ended and one.phase is Phase.RESTS)
    if cell != "error":
        assert allowed - {phase} <= reached, "the table states no more than what happens"


def test_a_whole_push_is_two_goals_and_one_answer() -> None:
    one = machine()
    assert one.update(ReachFound(), at()) == []
    (plan,) = one.update(PushOrdered(STROKE), at())
    assert isinstance(plan, PlanPush)
    (approach,) = one.update(PushPlanned(PLAN), at())
    assert (approach.trajectory, approach.touches) == (PLAN.approach, True)
    assert one.update(GoalEnded(SUCCEEDED), at(HOME)) == []  # the joints do not say so yet
    (stroke,) = one.update(TimePassed(), at(BESIDE))
    assert (stroke.trajectory, stroke.touches) == (PLAN.stroke, True)
    assert one.update(GoalEnded(SUCCEEDED), at(END)) == [Executed()]
    assert one.phase is Phase.RESTS


def test_a_stroke_that_was_broken_off_before_the_body_is_doubted() -> None:
    low = MotionConfig().tip_height
    for along, doubted in ((0.0, True), (0.4 * CLEARANCE, True), (0.6 * CLEARANCE, False)):
        (one,) = in_phase(Phase.STOPS)
        *_, retreat = one.update(TimePassed(), at(END, tip=np.array([along, 0.0, low])))
        assert isinstance(retreat, PlanRetreat)
        one.update(WayPlanned(way(END, UP)), at(END))
        (answer,) = one.update(GoalEnded(SUCCEEDED), at(UP))
        assert (answer.doubt is not None) == doubted
    (one,) = in_phase(Phase.STOPS)  # a state from before the end tells nothing
    old = replace(at(END, 2 * WAIT, tip=np.array([0.0, 0.0, low])), stamp=-1.0)
    one.update(TimePassed(), old)
    one.update(WayPlanned(FAILED), old)
    assert one._doubt is None


def test_joints_that_do_not_follow_a_goal_stop_the_arm_until_they_move() -> None:
    (one,) = in_phase(Phase.PUSHES)
    frozen = replace(at(BESIDE, 2.0), changed=0.0)
    one.update(GoalEnded(SUCCEEDED), frozen)
    actions = one.update(TimePassed(), replace(frozen, time=2.1 + WAIT))
    assert isinstance(actions[-1], Executed)
    one.update(PushOrdered(STROKE), replace(frozen, time=10.0))
    (refused,) = one.update(TimePassed(), replace(frozen, time=11.1))
    assert "did not follow the arm's last goal" in str(refused.error)
    assert one.update(PushOrdered(STROKE), at(BESIDE, 12.0)) and one.phase is Phase.PLANS


def test_a_push_waits_longer_for_the_table_of_reach() -> None:
    one = machine()
    assert one.update(PushOrdered(STROKE), at()) == []
    assert one.update(TimePassed(), at(time=FINDING - 1.0)) == []
    (refused,) = one.update(TimePassed(), at(time=FINDING + 1.0))
    assert "reach is being found out" in str(refused.error)


class Walk:
    """A node, a controller and a table of random fortune, around the machine."""

    def __init__(self, random, dry_run):
        self.random, self.one, self.dry_run = random, machine(dry_run), dry_run
        self.time = 0.0
        self.joints, self.tip = HOME, np.array([0.0, 0.0, 0.2])
        self.enabled, self.known, self.serves, self.still = True, True, True, True
        self.changed = self.stamp = 0.0
        self.goal = self.kind = None  # under way: the trajectory, and what it is for
        self.cancelled = False
        self.plans = []  # asked for, and not there yet
        self.pushes = self.answers = 0
        self.moved = False  # a body, by the push that is under way
        self.began = False  # the stroke of it
        self.hidden_since = None

    @property
    def arm(self):
        return ArmState(
            time=self.time, clock=self.time,
            joints=self.joints if self.known else None, tip=self.tip if self.known else None,
            stamp=self.stamp, changed=self.changed, still=self.still,
            unknown="" if self.known else "no /joint_states",
            disabled="" if self.enabled else "not enabled",
            missing="" if self.serves else "no controller",
            hidden=0.0 if self.hidden_since is None else self.time - self.hidden_since,
        )  # fmt: skip

    def tell(self, event):
        arm = self.arm
        sends = 0
        for action in self.one.update(event, arm):
            sends += isinstance(action, Send)
            self.do(action, arm)
        assert sends <= 1
        assert self.goal is None or self.cancelled or not arm.stopped, "a goal goes on unenabled"

    def do(self, action, arm):
        match action:
            case Send(goal, touches):
                assert not arm.stopped, "a goal was sent without a live enable"
                assert self.goal is None, "two goals at once"
                assert not self.dry_run, "a dry run moves nothing"
                assert touches == (goal in (PLAN.approach, PLAN.stroke))
                self.goal, self.cancelled, self.still = goal, False, False
                if touches and self.random.random() < 0.1:
                    self.goal, self.still = None, True
                    self.tell(SendRefused(StaleSceneError("a body was moved")))
            case Cancel():
                assert self.goal is not None and not self.cancelled
                self.cancelled = True
            case PlanPush() | PlanHome() | PlanRetreat():
                assert arm.joints is not None
                self.plans.append(action)
            case Executed(doubt):
                assert doubt is None or not self.moved, "what moved a body is in doubt"
                self.answer()
                self.hidden_since = self.time
            case Refused():
                assert not self.moved, "what moved a body was called not made"
                self.answer()

    def answer(self):
        self.answers += 1
        assert self.answers == self.pushes, "each push has one answer"
        self.moved = self.began = False

    # --- what may happen ------------------------------------------------------------------------

    def pass_time(self):
        self.time += self.random.choice([0.02, 0.1, 0.5, 2.0])
        if self.random.random() < 0.5:
            self.stamp = self.time
        self.still = self.still or (self.goal is None and self.random.random() < 0.5)
        if self.random.random() < 0.5:
            self.enabled = self.known = self.serves = True
        self.tell(TimePassed())

    def change(self):
        name = self.random.choice(["enabled", "known", "serves"])
        setattr(self, name, not getattr(self, name))
        self.tell(TimePassed())

    def order(self):
        if self.pushes > self.answers:
            with pytest.raises(BusyError):
                self.one.update(PushOrdered(STROKE), self.arm)
            return
        self.pushes += 1
        self.hidden_since = None
        self.tell(PushOrdered(NONE if self.random.random() < 0.1 else STROKE))

    def plan(self):
        if not self.plans:
            return
        asked = self.plans.pop(0)
        fails = self.random.random() < 0.2
        if isinstance(asked, PlanPush):
            self.tell(PushPlanned(FAILED if fails else PLAN))
        else:
            self.tell(WayPlanned(FAILED if fails else way(self.joints, UP)))

    def end(self, how=None):
        if self.goal is None:
            return
        luck = SUCCEEDED if self.random.random() < 0.6 else self.random.choice(ENDINGS)
        goal, ending = self.goal, how or luck
        share = 1.0 if ending.how is Ended.SUCCEEDED else self.random.random()
        self.goal, self.still = None, self.random.random() < 0.5
        if ending.how is not Ended.REJECTED:
            self.joints = goal.positions[0] + share * (goal.positions[-1] - goal.positions[0])
            if goal is PLAN.stroke:
                self.tip = np.array([share * LENGTH, 0.0, MotionConfig().tip_height])
                self.moved = self.began = share * LENGTH > CLEARANCE
            else:
                self.tip = np.array([0.0, 0.0, 0.2])
            self.changed = self.time
        self.tell(GoalEnded(ending))

    def find_reach(self):
        self.tell(ReachFound())


STEPS = (
    Walk.pass_time, Walk.pass_time, Walk.change, Walk.order, Walk.plan, Walk.end, Walk.end,
    Walk.find_reach,
)  # fmt: skip


@pytest.mark.parametrize("dry_run", [False, True])
def test_laws_hold_on_random_walks(dry_run, walks=1000):
    for seed in range(walks):
        random = Random(seed)
        walk = Walk(random, dry_run)
        if seed % 4:
            walk.find_reach()
        for _ in range(40):
            random.choice(STEPS)(walk)
        for _ in range(4):  # in the end all goals end, and no push is left without an answer
            walk.plan()
            walk.end(ABORTED)
            walk.time, walk.still = walk.time + FINDING + WAIT, True
            walk.tell(TimePassed())
        assert walk.answers == walk.pushes, seed


def test_the_laws_find_planted_faults(monkeypatch) -> None:
    """A machine that sends without a look at the signal, or calls a stroke not made, is caught."""

    def careless(self, goal, arm, touches=False):
        self._goal, self._sent, self._cancelled, self._arrives = goal, arm.time, False, None
        return [Send(goal, touches)]

    def untrue(self, ending, arm):
        return self._refuse(CancelledError("not made"))

    for name, fault in (("_send", careless), ("_after_stroke", untrue)):
        with monkeypatch.context() as patched:
            patched.setattr(PushExecution, name, fault)
            with pytest.raises(AssertionError):
                test_laws_hold_on_random_walks(dry_run=False)
