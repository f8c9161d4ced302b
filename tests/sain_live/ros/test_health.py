"""What the log says of nodes that report trouble."""

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from sain_live.ros.hearing import Health
from sain_live.state import Level, LiveState

OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN


@pytest.fixture
def known():
    return LiveState()


@pytest.fixture
def say(known):
    health = Health(known)

    def take(level, message):
        name = "/sain/mppi_node: planning"
        health.hear(
            DiagnosticArray(status=[DiagnosticStatus(level=level, name=name, message=message)])
        )

    return take


def lines(known):
    return [(line.kind, line.text) for line in known.log]


def test_while_the_graph_starts_trouble_is_told_once_and_is_no_fault(known, say):
    known.update(starting="waits for the model")
    for message in ("compiling 1 of 40 kernels", "compiling 2 of 40 kernels", "no model"):
        say(WARN, message)
    assert lines(known) == [(Level.NOTE, "planner: compiling 1 of 40 kernels")]


def test_later_trouble_is_a_fault_until_the_node_is_well(known, say):
    say(OK, "ready")
    for _ in range(2):
        say(WARN, "the model failed")
    say(OK, "pushing")
    assert lines(known) == [
        (Level.FAULT, "planner: the model failed"),
        (Level.NOTE, "planner: pushing"),
    ]


def test_what_a_page_that_comes_later_finds_is_a_note(known, say):
    say(WARN, "no push to make")
    assert lines(known) == [(Level.NOTE, "planner: no push to make")]
