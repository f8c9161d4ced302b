"""Each condition of a graph is printed once, and again after it has cleared."""

import pytest

from sain_bringup.conditions import AGAIN, FORGOTTEN, LASTS, Conditions, described

CAMERA = "camera: no image"


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def conditions(clock):
    return Conditions(clock)


@pytest.fixture
def heard(clock, conditions):
    """Report lines of one source for so long [s], once a second; returns what is printed."""

    def hear(seconds, line, period=1.0, **more):
        printed, end, due = [], clock.now + seconds, clock.now
        while clock.now < end:
            if clock.now >= due:
                conditions.report("camera", line() if callable(line) else line, **more)
                due += period
            printed += conditions.take()
            clock.now += 0.25
        return printed

    return hear


def test_a_warning_is_printed_once_within_three_seconds(heard, clock):
    assert heard(3.0, CAMERA) == [CAMERA]
    assert heard(60.0, CAMERA) == []


def test_one_that_clears_and_comes_back_is_printed_again(heard):
    assert heard(3.0, CAMERA) == [CAMERA]
    assert heard(1.0, "") == []
    assert heard(3.0, CAMERA) == [CAMERA]


def test_another_one_of_the_same_source_is_printed_beside_it(heard):
    assert heard(3.0, CAMERA) + heard(3.0, "camera: no tag") == [CAMERA, "camera: no tag"]


def test_a_warning_that_clears_at_once_is_not_printed(heard):
    assert heard(LASTS - 0.5, CAMERA) + heard(10.0, "") == []


def test_one_that_flickers_is_printed_once(heard):
    flicker = iter([CAMERA, ""] * 1000)
    assert heard(60.0, lambda: next(flicker), period=0.25) == [CAMERA]


def test_the_same_words_with_other_numbers_are_printed_when_they_last(heard):
    goals = ["the goal (0.9, 0.0) is out of reach", "the goal (0.8, 0.1) is out of reach"]
    printed = heard(20.0, goals[0]) + heard(AGAIN, goals[1])
    assert printed == goals


def test_one_whose_source_died_is_printed_again_when_it_comes_back(heard, clock):
    assert heard(3.0, CAMERA) == [CAMERA]
    clock.now += FORGOTTEN
    assert heard(3.0, CAMERA) == [CAMERA]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (
            "not enabled: the arm does not move",
            "arm_node: not enabled: the arm does not move; start in another terminal:"
            " ros2 run sain_arm enable",
        ),
        ("stop one; there are two", "arm_node: stop one; there are two"),
        ("over\nheated", "arm_node: over heated; look at the log of arm_node"),
    ],
)
def test_a_line_has_node_message_and_what_to_do(text, line):
    assert described("arm_node", text) == line
    assert len(described("arm_node", 500 * text)) <= 400
