"""What was seen of one body in one image."""

from dataclasses import dataclass

from jaxtyping import Float
from numpy import ndarray


@dataclass(frozen=True, eq=False)
class Sighting:
    """Where a body is, as an image shows it."""

    body: int  # its place in the file of bodies
    pose: Float[ndarray, "3"]  # (3,) x, y [m] and heading [rad] in the world
    covariance: Float[ndarray, "3 3"]  # (3, 3) of the pose
    outlines: Float[ndarray, "T C 2"]  # (T, C, 2) [px], what it was found by in the image
    score: float = 1.0  # share of what could be seen of it that was, 0 to 1
