"""Each condition of a graph is printed once, and again after it has cleared."""

import pytest

from sain_bringup.conditions import AGAIN, FORGOTTEN, LASTS, Conditions, described

CAMERA = "camera: no image"


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


NEAR, FAR = "the goal (0.9, 0.0) is out of reach", "the goal (0.8, 0.1) is out of reach"


@pytest.mark.parametrize(
    ("reports", "printed"),
    [
        ([(3.0, CAMERA)], [CAMERA]),  # within three seconds
        ([(3.0, CAMERA), (60.0, CAMERA)], [CAMERA]),  # once
        ([(3.0, CAMERA), (1.0, ""), (3.0, CAMERA)], [CAMERA, CAMERA]),  # cleared, and back
        ([(3.0, CAMERA), (3.0, "camera: no tag")], [CAMERA, "camera: no tag"]),
        ([(LASTS - 0.5, CAMERA), (10.0, "")], []),  # clears by itself
        (120 * [(0.25, CAMERA), (0.25, "")], [CAMERA]),  # flickers
        ([(20.0, NEAR), (AGAIN, FAR)], [NEAR, FAR]),  # other numbers, when they last
        ([(3.0, CAMERA), (FORGOTTEN, None), (3.0, CAMERA)], [CAMERA, CAMERA]),  # its source died
    ],
)
def test_each_condition_is_printed_once_and_again_after_it_has_cleared(reports, printed):
    clock = Clock()
    conditions, lines = Conditions(clock), []
    for seconds, line in reports:
        end = clock.now + seconds
        while clock.now < end:
            if line is not None and (clock.now % 1.0 == 0.0 or seconds < 1.0):
                conditions.report("camera", line)
            lines += conditions.take()
            clock.now += 0.25
    assert lines == printed


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
