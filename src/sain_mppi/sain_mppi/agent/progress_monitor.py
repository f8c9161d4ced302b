"""Whether pushes lead where they should: what was predicted against what happened."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from sain_core.scene import POSITION, TARGET
from sain_core.types import Scalars, Scene
from sain_mppi.algorithms.config import ProgressConfig

NEARER: Final = 0.99  # of the best so far: a resting cost below this share is progress


@dataclass(frozen=True)
class Surprise:
    """How far the last push led from where it should, for all N disks."""

    errors: Scalars  # (N,) [m], from the predicted place to the observed one
    expected: Scalars  # (N,) [m], errors up to these are no surprise

    @property
    def surprising(self) -> bool:
        """Whether mid disk or target is where it was not expected."""
        return bool((self.errors > self.expected)[: TARGET + 1].any())


class ProgressMonitor:
    """Follows one goal: compares each scene with the predicted one and with the best so far."""

    def __init__(self, config: ProgressConfig) -> None:
        """Begin without a past."""
        self._config = config
        self.reset()

    def use(self, config: ProgressConfig) -> None:
        """Judge by other settings from now on."""
        self._config = config

    def reset(self) -> None:
        """Forget how pushes came out."""
        self._before: Scene | None = None
        self._expected: Scene | None = None
        self._regions: Scalars | None = None
        self._best = np.inf
        self.without = 0  # pushes in a row without progress
        self.last: Surprise | None = None

    def expect(self, scene: Scene, predicted: Scene, regions: Scalars | None = None) -> None:
        """Take note of the scene (N, 8) to which a push from another scene (N, 8) should lead.

        `regions` (N,) [m] are the radii of the regions that should hold the disks, where known.
        An error inside its region does not trigger wider planning.
        """
        self._before, self._expected, self._regions = scene.copy(), predicted.copy(), regions

    def look(self, scene: Scene, rest_cost: float, noise: Scalars | None = None) -> None:
        """Take note of the present scene (N, 8), and of what it would cost to do nothing.

        `noise` (N,) [m] is by how much more places may seem to differ from what was expected.
        """
        before, expected = self._before, self._expected
        self.last = None
        pushed = before is not None and not np.array_equal(scene, before)
        if pushed and expected is not None and before is not None:
            if scene.shape == expected.shape:
                self.last = self._compare(before, expected, scene, noise)
            self.without += 1
        if rest_cost < NEARER * self._best:
            self.without, self._best = 0, rest_cost

    def _compare(
        self, before: Scene, expected: Scene, scene: Scene, noise: Scalars | None
    ) -> Surprise:
        errors = np.linalg.norm((scene - expected)[:, POSITION], axis=1)
        way = np.linalg.norm((expected - before)[:, POSITION], axis=1)
        band = np.maximum(self._config.surprise, self._config.surprise_share * way)
        if self._regions is not None:
            band = np.maximum(band, self._regions)
        if noise is not None:
            band = np.hypot(band, noise)
        return Surprise(errors, band)

    @property
    def concern(self) -> str:
        """Why to plan wider than usual; empty: there is no reason to."""
        last = self.last
        if last is not None and last.surprising:
            worst = int(np.argmax((last.errors / last.expected)[: TARGET + 1]))
            return (
                f"{('mid disk', 'target')[worst]} {1e3 * last.errors[worst]:.0f} mm from where it"
                f" should be, {1e3 * last.expected[worst]:.0f} mm were expected"
            )
        if self.without >= self._config.stalled_after:
            return f"{self.without} pushes brought nothing"
        return ""

    @property
    def hopeless(self) -> bool:
        """Whether there is no point in going on."""
        most = self._config.give_up_after
        return most > 0 and self.without >= most
