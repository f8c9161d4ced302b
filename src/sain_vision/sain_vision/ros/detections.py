"""``vision_msgs/Detection3DArray``: what was seen of bodies, by their names."""

from collections.abc import Iterable
from typing import Any, Final

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Vector3
from jaxtyping import Float
from numpy import ndarray
from vision_msgs.msg import Detection3D, Detection3DArray, ObjectHypothesisWithPose

from sain_core import wire
from sain_core.errors import InvalidInputError
from sain_core.ros import codec
from sain_core.ros.markers import make_pose
from sain_core.shapes.body_file import BodyFile
from sain_vision.detection.sighting import Sighting
from sain_vision.optics import turn_of
from sain_vision.scene.body_track import Observed

PLANAR: Final = np.array([0, 1, 5])  # x, y and the turn about z, of the six in a covariance
FIXED: Final = 1e-6  # variance [m^2], [rad^2] of what the table fixes


def encode_sightings(
    sightings: Iterable[Sighting], bodies: BodyFile, frame: str, stamp: Time
) -> Detection3DArray:
    """Return what was seen as a message."""
    header = codec.header(stamp)
    header.frame_id = frame
    detections = []
    for seen in sightings:
        x, y, heading = seen.pose.tolist()
        pose = make_pose(x, y, bodies.heights[seen.body] / 2, heading)
        if seen.rotation is not None:
            turn = pose.orientation
            turn.x, turn.y, turn.z, turn.w = turn_of(seen.rotation).tolist()
        result = ObjectHypothesisWithPose()
        result.hypothesis.class_id = bodies.bodies.shapes[seen.body].name
        result.hypothesis.score = float(seen.score)
        result.pose.pose = pose
        result.pose.covariance = _encode_covariance(seen.covariance)
        one = Detection3D(header=header, results=[result], id=bodies.names[seen.body])
        width = 2.0 * bodies.radii[seen.body]
        one.bbox.center = pose
        one.bbox.size = Vector3(x=width, y=width, z=bodies.heights[seen.body])
        detections.append(one)
    return Detection3DArray(header=header, detections=detections)


def decode_detections(message: Any, bodies: BodyFile, frame: str) -> dict[int, Observed]:
    """Return what a message says of bodies; what has another name is somebody else's.

    Raises `InvalidInputError`: another frame, NaN, a tilted body, or one body twice.
    """
    if message.header.frame_id != frame:
        raise InvalidInputError(
            f"the detections are in frame {message.header.frame_id!r}; they must be in {frame!r}"
        )
    seen: dict[int, Observed] = {}
    for one in message.detections:
        if one.id not in bodies.names or not one.results:
            continue
        body = bodies.names.index(one.id)
        if body in seen:
            raise InvalidInputError(f"{bodies.called(body)} is in one message twice")
        best = max(one.results, key=lambda result: result.hypothesis.score)
        what = f"the pose of {bodies.called(body)}"
        pose = wire.decode_pose(best.pose.pose, what, wire.TIPPED)
        seen[body] = Observed(pose, _decode_covariance(best.pose.covariance, bodies.called(body)))
    return seen


def _encode_covariance(covariance: Float[ndarray, "3 3"]) -> Float[ndarray, "36"]:
    whole = FIXED * np.eye(6)
    whole[np.ix_(PLANAR, PLANAR)] = covariance
    return whole.ravel()


def _decode_covariance(values: Any, what: str) -> Float[ndarray, "3 3"] | None:
    """Return the covariance of a pose in the plane; all zeros: it is not known."""
    whole = np.array(values, dtype=np.float64).reshape(6, 6)
    planar = whole[np.ix_(PLANAR, PLANAR)]
    if not planar.any():
        return None
    if not np.isfinite(planar).all() or np.linalg.eigvalsh(planar).min() <= 0.0:
        raise InvalidInputError(f"the covariance of {what} is not positive definite")
    return planar
