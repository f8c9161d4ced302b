"""Extremely randomised trees (Geurts et al. 2006, scikit-learn): the outsider beside our network.

They see the geometry of the contact in the body's frame, and predict how the body moves there. On a
physics they see its prediction, too, and predict what it leaves.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from sklearn.ensemble import ExtraTreesRegressor

from benchmarks.real.pushes import Names, PushTable
from benchmarks.real.rows import Predicted, Predictor, Row
from sain_core.push import SPAN_X
from sain_core.scene import unit
from sain_core.shapes.library import get_shape
from sain_core.types import Points, Scalars

SCALE: Final = np.array([1e3, 1e3, 180.0 / np.pi])  # a millimetre and a degree weigh the same

Features = Float[ndarray, "M F"]


@dataclass(frozen=True)
class Trees:
    """Trees on the contact, and on a physics where there is one."""

    on: Row | None = None
    trees: int = 100
    seed: int = 0
    learns_anew: bool = True

    @property
    def key(self) -> str:
        return "trees" if self.on is None else f"trees_on_{self.on.key}"

    @property
    def title(self) -> str:
        return "trees" if self.on is None else f"trees on {self.on.title}"

    @property
    def identity(self) -> str:
        return f"{self.trees} trees, seed {self.seed}, on {self.on and self.on.identity}"

    def fit(self, train: PushTable, own: PushTable) -> Predictor:
        """Grow trees on all pushes."""
        known = train.and_also(own)
        physics = None if self.on is None else self.on.fit(train, own)
        forest = ExtraTreesRegressor(self.trees, n_jobs=-1, random_state=self.seed)
        fitted = FittedTrees(physics, np.unique(known.shape), np.unique(known.surface), forest)
        base = fitted.base(known)
        forest.fit(fitted.features(known, base), SCALE * (known.moves - base))
        return fitted


@dataclass(frozen=True, eq=False)
class FittedTrees:
    """Trees that were grown on pushes of these shapes and surfaces."""

    physics: Predictor | None
    shapes: Names
    surfaces: Names
    forest: ExtraTreesRegressor

    def predict(self, pushes: PushTable) -> Predicted:
        """Return the mean of the trees, added to the physics."""
        base = self.base(pushes)
        found = self.forest.predict(self.features(pushes, base)) / SCALE
        return Predicted(pushes.placed(base + found))

    def base(self, pushes: PushTable) -> Float[ndarray, "M 3"]:
        """Return the moves that the physics predicts; none without one."""
        if self.physics is None:
            return np.zeros((len(pushes), 3))
        return pushes.moves_to(self.physics.predict(pushes).poses)

    def features(self, pushes: PushTable, base: Float[ndarray, "M 3"]) -> Features:
        """Return what the trees see; a shape or a surface that is new to them is all zeros."""
        known = [pushes.shape[:, None] == self.shapes, pushes.surface[:, None] == self.surfaces]
        parts = [contact_features(pushes), outline_features(pushes), *known]
        return np.column_stack(parts if self.physics is None else [*parts, SCALE * base])


def contact_features(pushes: PushTable) -> Features:
    """Return the geometry of the tool's way and of its first contact, in the body's frame.

    Lengths are in millimetres. The body's heading is there, as friction may differ with it.
    """
    way, inward = (pushes.in_body(unit(angle)) for angle in (pushes.heading, pushes.normal))
    start = 1e3 * pushes.in_body(pushes.start - pushes.before[:, :2])
    contact = 1e3 * pushes.in_body(pushes.contact - pushes.before[:, :2])
    gone = 1e3 * np.minimum(pushes.distance, pushes.length)
    length = 1e3 * pushes.length
    span = 1e3 * pushes.in_body(pushes.second[:, :2])  # zeros of one disk are of no use to trees
    some = any(part.action[:, SPAN_X:].any() for part in pushes.data.parts)
    second = [span, pushes.second[:, 2]] if some else []
    return np.column_stack([
        start, start + length[:, None] * way, way, contact, inward, length, gone,
        (way * inward).sum(axis=1), _across(inward, way),
        _across(contact, way), _across(contact, inward),
        unit(pushes.before[:, 2]), pushes.speed, pushes.tip, *second,
    ])  # fmt: skip


def outline_features(pushes: PushTable) -> Features:
    """Return what tells outlines apart: size, area, and second moments along and across, in mm."""
    of_shape = {name: _moments(get_shape(str(name)).outline(1.0)) for name in set(pushes.shape)}
    scale = 1e3 * pushes.radius
    return scale[:, None] * np.array([of_shape[name] for name in pushes.shape])


def _moments(outline: Points) -> Float[ndarray, "4"]:
    """Return the radius, the root of the area and the spreads of points along an outline."""
    after = np.roll(outline, -1, axis=0)
    area = 0.5 * float(_across(outline, after).sum())
    share = np.linalg.norm(after - outline, axis=1)
    middle = (outline + after) / 2
    spread = np.sqrt(np.average(middle**2, axis=0, weights=share))
    return np.array([np.hypot(*outline.T).max(), np.sqrt(area), *spread])


def _across(first: Points, second: Points) -> Scalars:
    return np.asarray(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
