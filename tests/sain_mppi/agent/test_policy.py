"""Answers of a policy that are no pushes: each is refused, counted, and moves nothing."""

import gc
import subprocess
import sys
import threading
import time
from functools import partial
from threading import Event

import numpy as np
import pytest

from sain_core.errors import CancelledError, ModelUnavailableError, NoPushError
from sain_core.goal import Goal
from sain_core.policy import Policy
from sain_core.push import BODY, make_push
from sain_core.shapes.bodies import PAPER_DISKS
from sain_mppi.agent.agent import Agent, AgentConfig, act
from sain_mppi.agent.events import EpisodeBegun, GoalGiven, PushDecision, SceneObserved, Stop, Task
from sain_mppi.agent.policy import PolicyDecider, TimedCall
from tests.sain_mppi.ros.straw import START

PUSH = make_push(0.0, 0.1, 0.05, body=0.2)
CONFIG = AgentConfig(max_refusals=3, policy_timeout=0.2)


def late():
    time.sleep(0.35)
    return PUSH


def broken():
    raise KeyError("weights")


class Answers(Policy):
    """Gives one answer after another, the last again and again."""

    def __init__(self, *answers):
        self.answers, self.asked, self.resets = answers, 0, 0

    def select_action(self, observation):
        answer = self.answers[min(self.asked, len(self.answers) - 1)]
        self.asked += 1
        return answer() if callable(answer) else answer

    def reset(self, seed):
        self.resets += 1


def decide(policy, *tasks):
    decider = PolicyDecider(policy, "theirs", CONFIG)
    agent = Agent(decider, CONFIG)
    act(agent, EpisodeBegun(1, PAPER_DISKS), SceneObserved(START, 1, 1))
    given = [GoalGiven(Task(number, 0, Goal.place(0.7, 0.05), 0)) for number in tasks or (1,)]
    return decider, [act(agent, goal) for goal in given]


WRONG = [
    (np.array([0.0, np.nan, 0.0, 0.1, 0.2]), "location of the action is nan; must be finite"),
    (np.zeros(4), r"an array of float64 with shape \(4,\); needed: numbers with shape \(5,\)"),
    ("push", "an array of <U4"),
    ([0.0, [0.1], 0.0], "the action is no array of numbers: .*inhomogeneous"),
    (lambda: sys.exit("done"), "it raised SystemExit: done"),
    (make_push(4.0, 0.0, 0.1), "location of the action is 4; allowed: -3.14159 to 3.14159"),
    (make_push(0.0, 0.0, 0.4), "length of the action is 0.4; allowed: 0 to 0.15"),
    (make_push(0.0, 0.0, 0.1, body=1), "body of the action is 1; allowed: -0.5 to 0.5"),
    (broken, "it raised KeyError: 'weights'"),
    (late, "it did not answer within 0.2 s"),
]


@pytest.mark.parametrize(("answer", "reason"), WRONG, ids=[reason[:20] for _, reason in WRONG])
def test_what_is_no_push_is_refused_counted_and_ends_the_goal(answer, reason):
    decider, (stop,) = decide(Answers(answer))
    assert isinstance(stop, Stop) and isinstance(stop.error, NoPushError)
    assert stop.error.args[0].startswith("3 answers in a row were refused, the last: policy theirs")
    with pytest.raises(NoPushError, match=reason):
        raise stop.error
    assert decider.figures["policy_refused"] == 3


def test_a_policy_that_recovers_pushes_and_the_plan_says_what_was_refused():
    decider, (decision,) = decide(Answers(late, np.full(5, np.inf), PUSH))
    assert isinstance(decision, PushDecision)
    assert decision.push.tolist() == [0.0, *PUSH[BODY + 1 :]]  # the body is rounded
    assert decision.warning.startswith("2 answers were refused, the last: policy theirs: body of")
    assert (decider.figures["policy_refused"], decider.trouble) == (2, "")


def test_a_policy_forgets_at_each_goal():
    policy = Answers(PUSH)
    decide(policy, 1, 2)
    assert (policy.resets, policy.asked) == (2, 2)


def test_one_thread_answers_all_calls_also_after_a_late_one():
    """What a policy keeps for each thread is there at the next call, and is not used by two."""
    call, kept, hold, threads = TimedCall(), threading.local(), Event(), []

    def counted(held: bool = False) -> int:
        threads.append(threading.get_ident())
        kept.count = getattr(kept, "count", 0) + 1
        if held:
            hold.wait()
        return kept.count

    assert call(counted, 9.0, Event()) == 1
    for work in (partial(counted, held=True), counted):  # the second is not begun
        with pytest.raises(ModelUnavailableError, match=r"did not answer within 0\.05 s"):
            call(work, 0.05, Event())
    hold.set()
    assert call(counted, 9.0, Event()) == 3
    assert len(threads) == 3 and set(threads) == {threads[0]} != {threading.get_ident()}


def test_what_a_policy_raises_ends_no_later_call():
    call = TimedCall()
    for raises, error in ((broken, KeyError), (sys.exit, ModelUnavailableError)):
        with pytest.raises(error):
            call(raises, 1.0, Event())
    assert call(lambda: 3, 1.0, Event()) == 3


def test_a_call_that_is_not_wanted_any_more_ends():
    cancelled, hold = Event(), Event()
    threading.Timer(0.05, cancelled.set).start()
    with pytest.raises(CancelledError):
        TimedCall()(hold.wait, 9.0, cancelled)
    hold.set()


def test_the_thread_ends_with_whoever_called():
    def others() -> set[threading.Thread]:
        return {one for one in threading.enumerate() if one.name == "policy"}

    before = others()
    decider, _ = decide(Answers(PUSH))
    (thread,) = others() - before
    del decider, _
    gc.collect()
    thread.join(1.0)
    assert not thread.is_alive()


def test_a_policy_that_never_answers_does_not_keep_the_process():
    code = "import threading, time; from sain_mppi.agent.policy import TimedCall as C\n"
    code += "C()(lambda: time.sleep(60), 0.05, threading.Event())"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=30)
    assert ended.returncode == 1 and b"did not answer within" in ended.stderr
