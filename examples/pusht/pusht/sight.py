"""Where agent and block are in a picture of stable-worldmodel's Push-T: colours, then outlines.

Given are the outlines of agent and block. The colours are learned from the first picture and that
of the goal: a body has the one that was drawn along its rim, and inside it one that is a fifth
lighter. No other colour has both. Which body has which is decided by how well its outline fits.
"""

from dataclasses import dataclass
from typing import Final, Self

import cv2
import numpy as np

from sain_core.scene import wrap_angle

SCALE: Final = 512.0 / 224.0  # [px], of a picture's pixel
LIGHTER: Final = 1.2  # of a body's inside
RIM: Final = 4  # pixels of a picture along its sides, with the walls
FEW: Final = 3  # pixels of a colour in a picture; fewer are no part of a body
ANGLES: Final = np.radians(np.arange(0.0, 360.0, 5.0))
NEARBY: Final = np.radians(np.arange(-30.0, 31.0, 5.0))  # about a predicted angle
POOR: Final = 0.6  # share of the outline's and the mask's union that they share; below: look again
INWARD: Final = 0.4  # pixels, of a mask's outermost ones from the outline
GATES: Final = (4.0, 3.0, 2.0, 1.5, 1.5, 1.5)  # pixels from the outline, of those that count


def to_picture(places: np.ndarray) -> np.ndarray:
    """Return where places (..., 2) [px] are in a picture."""
    return (places + 0.5) / SCALE - 0.5


def from_picture(places: np.ndarray) -> np.ndarray:
    """Return the places (..., 2) [px] of where they are in a picture."""
    return (places + 0.5) * SCALE - 0.5


@dataclass(frozen=True, eq=False)
class Fit:
    """An outline where a mask is.

    Attributes:
        pose: (3,) of the outline's centroid [px], and its angle, with y downwards.
        share: of the union of outline and mask, that both cover.
    """

    pose: np.ndarray
    share: float


@dataclass(frozen=True, eq=False)
class Seen:
    """A body by its outline and colours.

    Attributes:
        outline: (M, 2) about its centroid [px], with y downwards.
        is_round: whether it has no angle.
        colours: (2, 3) of rim and inside.
    """

    outline: np.ndarray
    is_round: bool
    colours: np.ndarray

    def mask(self, picture: np.ndarray) -> np.ndarray:
        """Return which pixels of a picture have its colours."""
        return _has(picture, self.colours[0]) | _has(picture, self.colours[1])

    def fit(self, mask: np.ndarray, hidden: np.ndarray, angles: np.ndarray) -> Fit:
        """Return the best of fits that begin with some angles; what is hidden does not count."""
        rows, columns = np.nonzero(mask)
        if len(rows) < FEW:
            return Fit(np.zeros(3), 0.0)
        middle = np.array([columns.mean(), rows.mean()])
        starts = [np.array([*middle, angle]) for angle in (angles[:1] if self.is_round else angles)]
        start = max(starts, key=lambda pose: self._share(mask, hidden, pose))
        pose = self._refined(mask, hidden, start)
        share = self._share(mask, hidden, pose)
        return Fit(np.append(from_picture(pose[:2]), wrap_angle(pose[2])), share)

    def _placed(self, pose: np.ndarray) -> np.ndarray:
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        return pose[:2] + self.outline / SCALE @ np.array([[cos, sin], [-sin, cos]])

    def _share(self, mask: np.ndarray, hidden: np.ndarray, pose: np.ndarray) -> float:
        drawn = np.zeros(mask.shape, np.uint8)
        cv2.fillPoly(drawn, [np.round(16.0 * self._placed(pose)).astype(np.int32)], 1, shift=4)
        covered = (drawn > 0) & ~hidden
        return float((covered & mask).sum() / max((covered | mask).sum(), 1))

    def _refined(self, mask: np.ndarray, hidden: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """Return the pose for which the mask's outermost pixels are nearest to the outline."""
        around = cv2.dilate(hidden.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        inner = cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        rows, columns = np.nonzero(mask & ~inner & ~around)
        points = np.stack([columns, rows], axis=-1).astype(float)
        for gate in GATES:
            errors, normals = _off(points, self._placed(pose))
            used = np.abs(errors) < gate
            if used.sum() < FEW:
                return pose
            arm = points[used] - pose[:2]
            turning = arm[:, 0] * normals[used, 1] - arm[:, 1] * normals[used, 0]
            gradient = np.column_stack([normals[used], turning * (not self.is_round)])
            information = gradient.T @ gradient + np.diag([1e-3, 1e-3, 1.0])
            pose = pose + np.linalg.solve(information, gradient.T @ (errors[used] + INWARD))
        return pose


@dataclass(frozen=True, eq=False)
class Eyes:
    """Sees agent and block."""

    agent: Seen
    block: Seen

    @classmethod
    def learned(
        cls, pictures: list[np.ndarray], agent: np.ndarray, block: np.ndarray, is_round: bool
    ) -> Self:
        """Return eyes for the colours in pictures, with the outlines (M, 2) of agent and block."""
        pairs = _pairs(pictures)
        bodies = [[Seen(agent, is_round, pair), Seen(block, False, pair)] for pair in pairs]
        shares = np.array([[_shown(one, pictures) for one in both] for both in bodies])
        best = max(
            ((first, second) for first in range(len(pairs)) for second in range(len(pairs))),
            key=lambda choice: (
                (shares[choice[0], 0] + shares[choice[1], 1]) * (choice[0] != choice[1])
            ),
        )
        return cls(bodies[best[0]][0], bodies[best[1]][1])

    def look(
        self, picture: np.ndarray, block: float | None = None, agent: float | None = None
    ) -> tuple[Fit, Fit]:
        """Return the fits of agent and block, near their angles where these are given."""
        own, other = self.agent.mask(picture), self.block.mask(picture)
        return _near(self.agent, own, other, agent), _near(self.block, other, own, block)


def _near(body: Seen, mask: np.ndarray, hidden: np.ndarray, angle: float | None) -> Fit:
    if angle is not None:
        fit = body.fit(mask, hidden, angle + NEARBY)
        if fit.share > POOR:
            return fit
    return body.fit(mask, hidden, ANGLES)


def _has(picture: np.ndarray, colour: np.ndarray) -> np.ndarray:
    same = np.abs(picture.astype(np.int16) - colour).max(axis=-1) <= 1
    same[:RIM] = same[-RIM:] = same[:, :RIM] = same[:, -RIM:] = False
    return same


def _pairs(pictures: list[np.ndarray]) -> list[np.ndarray]:
    """Return colours (2, 3) of rims and insides that pictures may have, but for the background."""
    inner = np.concatenate([one[RIM:-RIM, RIM:-RIM].reshape(-1, 3) for one in pictures])
    colours, counts = np.unique(inner, axis=0, return_counts=True)
    background = colours[counts.argmax()]
    pairs = []
    for dark in colours[counts >= FEW].astype(np.int16):
        light = np.minimum(np.round(LIGHTER * dark), 255).astype(np.int16)
        there = (np.abs(colours - light).max(axis=-1) <= 1) & (counts >= FEW)
        if there.any() and (dark != background).any() and (light != background).any():
            pairs.append(np.stack([dark, light]))
    return pairs


def _shown(body: Seen, pictures: list[np.ndarray]) -> float:
    """Return how well a body fits into pictures."""
    nothing = np.zeros(pictures[0].shape[:2], bool)
    return float(np.mean([body.fit(body.mask(one), nothing, ANGLES).share for one in pictures]))


def _off(points: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return how far points (P, 2) are outside of an outline (M, 2), and normals (P, 2) of it."""
    ways = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(*ways.T)
    away = points[:, None] - corners
    along = np.clip((away * ways).sum(-1) / lengths**2, 0.0, 1.0)
    feet = corners + along[..., None] * ways
    nearest = np.hypot(*np.moveaxis(points[:, None] - feet, -1, 0)).argmin(axis=1)
    sign = np.sign((corners[:, 0] * ways[:, 1] - corners[:, 1] * ways[:, 0]).sum())
    normals = sign * np.stack([ways[:, 1], -ways[:, 0]], axis=-1) / lengths[:, None]
    rows = np.arange(len(points))
    errors = (away[rows, nearest] * normals[nearest]).sum(-1)
    return errors, normals[nearest]
