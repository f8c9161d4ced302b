"""What the log says of nodes that report trouble."""

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from sain_live.ros.updates import Health
from sain_live.state import Level, LiveState

OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN


@pytest.fixture
def state():
    return LiveState()


@pytest.fixture
def say(state):
    health = Health(state)

    def take(level, message):
        name = "/sain/mppi_node: planning"
        health.update(
            DiagnosticArray(status=[DiagnosticStatus(level=level, name=name, message=message)])
        )

    return take


def lines(state):
    return [(line.kind, line.text) for line in state.log]


def test_later_trouble_is_a_fault_until_the_node_is_well(state, say):
    say(OK, "ready")
    for _ in range(2):
        say(WARN, "the model failed")
    say(OK, "pushing")
    assert lines(state) == [
        (Level.FAULT, "planner: the model failed"),
        (Level.NOTE, "planner: pushing"),
    ]
