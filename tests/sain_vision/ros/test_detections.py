"""Detections of others: what cannot be is refused, and names of others are left alone."""

from dataclasses import replace

import numpy as np
import pytest
from vision_msgs.msg import Detection3D

from sain_core.errors import InvalidInputError
from sain_core.ros import codec
from sain_vision.detection.sighting import Sighting
from sain_vision.ros.detections import decode_detections, encode_sightings
from tests.sain_vision.pictures import file_of

BODIES = replace(file_of((), ()), names=("mug", "target"))
POSE, COVARIANCE = np.array([0.5, 0.1, 0.3]), np.diag([1e-6, 2e-6, 1e-4])
SEEN = Sighting(1, POSE, COVARIANCE, np.zeros((0, 4, 2)))


def message():
    return encode_sightings([SEEN], BODIES, "world", codec.encode_time(0))


def test_what_is_written_is_read_and_names_of_others_are_left_alone():
    written = message()
    written.detections.append(Detection3D(id="cat"))
    (found,) = decode_detections(written, BODIES, "world").items()
    assert found[0] == 1
    np.testing.assert_allclose(found[1].pose, POSE)
    np.testing.assert_allclose(found[1].covariance, COVARIANCE)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda m: setattr(m.header, "frame_id", "map"), "in frame 'map'; they must be in 'world'"),
        (
            lambda m: m.detections.extend(list(m.detections)),
            "is in one message twice",
        ),
    ],
)
def test_what_cannot_be_is_refused(change, text):
    written = message()
    change(written)
    with pytest.raises(InvalidInputError, match=text):
        decode_detections(written, BODIES, "world")
