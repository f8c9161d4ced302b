"""What a learner said last in a recording."""

from types import SimpleNamespace

import pytest

from sain_bags.report.content import describe_learning
from sain_core.errors import DatasetError


def bag(*messages):
    received = [SimpleNamespace(message=one, topic="/sain/learning") for one in messages]
    return SimpleNamespace(path="bag", messages=lambda types: iter(received))


def learning(pushes, value=(0.5, float("nan"))):
    curve = SimpleNamespace(
        name="physics", unit="m", pushes=[1, pushes], value=value, low=value, high=value
    )
    event = SimpleNamespace(pushes=1, kind="loaded", text="a network")
    return SimpleNamespace(
        laboratory="mine", service="physics", pushes=pushes, errors=[curve], parameters=[],
        events=[event],
    )  # fmt: skip


def test_the_last_message_counts_and_nothing_is_nan():
    shown = describe_learning(bag(learning(2), learning(5)))
    assert shown is not None
    assert (shown["pushes"], shown["events"]) == (5, [[1, "loaded", "a network"]])
    assert shown["errors"][0]["rows"] == [[0.5, 0.5, 0.5], [None, None, None]]


def test_without_a_learner_there_is_nothing():
    assert describe_learning(bag()) is None


def test_columns_that_differ_are_an_error():
    with pytest.raises(DatasetError, match=r"curve 'physics' has columns of \[2, 1, 1, 1\]"):
        describe_learning(bag(learning(3, value=(0.5,))))
