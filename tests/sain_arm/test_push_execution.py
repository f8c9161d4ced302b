"""The state machine of a push: every event in every phase, and laws on random walks."""

import re
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from sain_arm.planning.arm_config import MotionConfig
from sain_arm.planning.push_events import (
    ArmState,
    Executed,
    GoalEnded,
    Phase,
    PlanAhead,
    PlanPush,
    PlanRetreat,
    PushOrdered,
    PushPlanned,
    ReachFound,
    Refused,
    Send,
    TimePassed,
    WayPlanned,
)
from sain_arm.planning.push_execution import AGAIN, FINDING, HIDES, WAIT, PushExecution
from sain_core.errors import BusyError, CancelledError
from tests.sain_arm.random_pushes import (
    ABORTED,
    BESIDE,
    CLEARANCE,
    END,
    ENDINGS,
    EXPECTED,
    FAILED,
    HOME,
    PLAN,
    STROKE,
    SUCCEEDED,
    UP,
    machine,
    walk,
    way,
)

REST = ArmState(time=0.0, clock=0.0, joints=HOME, stamp=0.0, changed=0.0, still=True)


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
    if phase in (Phase.RESTS, Phase.TRAVELS):
        steps[4:] = [(GoalEnded(SUCCEEDED), at(END)), (TimePassed(), at(END, hidden=HIDES))]
    for event, arm in steps:
        one.update(event, arm)
        if one.phase is phase:
            break
    assert one.phase is phase
    if phase is Phase.PLANS:
        planned = on_the_way()
        planned.update(PushPlanned(PLAN), at(END))
        return [one, on_the_way(), planned]
    if phase is not Phase.TRAVELS:
        return [one]
    sent = deepcopy(one)
    sent.update(WayPlanned(way(END, HOME)), at(END))
    return [one, sent]


def on_the_way():
    """Return a machine that plans a push while the arm goes on from the stroke before."""
    (one,) = in_phase(Phase.RESTS)
    (ahead,) = one.update(TimePassed(), at(END, expects=EXPECTED))
    assert isinstance(ahead, PlanAhead) and (ahead.joints == END).all()
    (sent,) = one.update(WayPlanned(way(END, BESIDE)), at(END))
    assert not sent.touches
    (planned,) = one.update(PushOrdered(STROKE), at(END, still=False))
    assert (planned.joints == BESIDE).all()
    return one


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
    "expects": lambda joints: at(joints, expects=EXPECTED),
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
                    rest = (Phase.RESTS, Phase.TRAVELS)
                    assert one.phase in allowed or (ended and one.phase in rest)
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


def test_a_push_that_comes_on_the_way_follows_it_without_a_rest() -> None:
    one = on_the_way()
    assert one.update(PushPlanned(PLAN), at(END, still=False)) == []  # two goals at once
    (approach,) = one.update(GoalEnded(SUCCEEDED), at(BESIDE, still=False))
    assert (approach.trajectory, approach.touches) == (PLAN.approach, True)
    one = on_the_way()
    assert one.update(GoalEnded(SUCCEEDED), at(BESIDE)) == []
    (approach,) = one.update(PushPlanned(PLAN), at(BESIDE))
    assert approach.trajectory is PLAN.approach


def test_the_arm_goes_on_only_from_where_its_stroke_ended() -> None:
    """Somebody may have moved it since, or may while it is not enabled."""
    for arm in (at(BESIDE), at(END, disabled="not enabled"), replace(at(None), unknown="no")):
        (one,) = in_phase(Phase.RESTS)
        assert one.update(TimePassed(), replace(arm, expects=EXPECTED)) == []
        assert one.update(TimePassed(), at(END, expects=EXPECTED)) == []
    (one,) = in_phase(Phase.RESTS)
    assert one.update(TimePassed(), at(END)) == []
    assert one.update(TimePassed(), at(END, expects=EXPECTED))


def test_a_push_from_the_end_of_a_way_that_failed_is_refused() -> None:
    for steps in (
        [(GoalEnded(ABORTED), at(END)), (PushPlanned(PLAN), at(END))],
        [(PushPlanned(PLAN), at(END)), (GoalEnded(ABORTED), at(END))],
        [(TimePassed(), at(END, disabled="no")), (PushPlanned(PLAN), at(END)),
         (GoalEnded(SUCCEEDED), at(BESIDE))],
    ):  # fmt: skip
        one = on_the_way()
        actions = [action for event, arm in steps for action in one.update(event, arm)]
        assert isinstance(actions[-1].error, BusyError) and one.phase is Phase.RESTS
        assert not any(isinstance(action, Send) for action in actions)


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


@pytest.mark.parametrize("dry_run", [False, True])
def test_laws_hold_on_random_walks(dry_run, events=6000):
    assert walk(events, dry_run)[0] >= events


def test_the_laws_find_planted_faults(monkeypatch) -> None:
    """A machine that sends without a look at the signal, or calls a stroke not made, is caught."""

    def careless(self, goal, arm, touches=False):
        self._goal, self._sent, self._cancelled, self._arrives = goal, arm.time, False, None
        return [Send(goal, touches)]

    def untrue(self, ending, arm):
        return self._refuse(CancelledError("not made"))

    def stubborn(self, arm):
        return []

    def again(self, ending, arm):
        self.phase = Phase.PUSHES
        return self._send(self._plan.stroke, arm, touches=True)

    for name, fault in (
        ("_send", careless),
        ("_after_stroke", untrue),
        ("_cancel_if_stopped", stubborn),
        ("_after_approach", again),
    ):
        with monkeypatch.context() as patched:
            patched.setattr(PushExecution, name, fault)
            with pytest.raises(AssertionError):
                walk(6000)


def test_a_push_after_a_failed_approach_is_planned_once_the_arm_is_seen_to_rest_later() -> None:
    """A controller that calls a goal aborted may begin to move after that."""
    (one,) = in_phase(Phase.APPROACHES)
    (refused,) = one.update(GoalEnded(ABORTED), at())
    assert isinstance(refused, Refused)
    assert one.update(PushOrdered(STROKE), at(time=0.01)) == []
    assert one.update(TimePassed(), at(time=0.9 * AGAIN)) == []
    (planned,) = one.update(TimePassed(), at(time=AGAIN + 0.1))
    assert isinstance(planned, PlanPush)
