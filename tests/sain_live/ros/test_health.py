"""What the log says of nodes that report trouble."""

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from sain_live.ros.updates import Health
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
        health.update(
            DiagnosticArray(status=[DiagnosticStatus(level=level, name=name, message=message)])
        )

    return take


def lines(known):
    return [(line.kind, line.text) for line in known.log]


def test_later_trouble_is_a_fault_until_the_node_is_well(known, say):
    say(OK, "ready")
    for _ in range(2):
        say(WARN, "the model failed")
    say(OK, "pushing")
    assert lines(known) == [
        (Level.FAULT, "planner: the model failed"),
        (Level.NOTE, "planner: pushing"),
    ]
