"""What was seen of one body in one image."""

from dataclasses import dataclass

from jaxtyping import Float
from numpy import ndarray


@dataclass(frozen=True, eq=False)
class Sighting:
    """Where a body is, as an image shows it.

    Attributes:
        body: its place in the file of bodies.
        pose: (3,) x, y [m] and heading [rad] in the world.
        covariance: (3, 3) of the pose.
        outlines: (T, C, 2) [px], what it was found by in the image.
        score: share of what could be seen of it that was, 0 to 1.
    """

    body: int
    pose: Float[ndarray, "3"]
    covariance: Float[ndarray, "3 3"]
    outlines: Float[ndarray, "T C 2"]
    score: float = 1.0
