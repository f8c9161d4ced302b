"""Whether pushes lead where they should: what was predicted against what happened."""

from dataclasses import dataclass

import numpy as np

from sain_core.config import Config, option
from sain_core.scene import MID, POSITION, TARGET
from sain_core.types import Scalars, Scene

NEARER = 0.99  # of the best so far: what the cost of staying must fall below to count as progress


@dataclass(frozen=True)
class ProgressConfig(Config):
    """When plans are made wider, and when there is no point in going on."""

    surprise: float = option(
        0.01,
        "error of a predicted place that is none, however short the way",
        unit="m",
        minimum=0.0,
    )
    surprise_share: float = option(
        0.3, "the same as a share of the predicted way, where that is more", minimum=0.0
    )
    stalled_after: int = option(
        3, "pushes in a row without progress after which plans are wider", minimum=1
    )
    give_up_after: int = option(
        12, "pushes in a row without progress after which there are no more; 0: never", minimum=0
    )


@dataclass(frozen=True)
class LastPush:
    """What became of the last push that was planned, for all N disks."""

    errors: Scalars  # (N,) [m], from the predicted place to the one where it is
    expected: Scalars  # (N,) [m], errors up to these are no surprise

    @property
    def surprising(self) -> bool:
        """Whether mid disk or target is where it was not expected."""
        return bool((self.errors > self.expected)[[MID, TARGET]].any())


class Progress:
    """Follows one goal: compares each scene with what was expected and with the best so far."""

    def __init__(self, config: ProgressConfig) -> None:
        """Begin without a past."""
        self._config = config
        self._before: Scene | None = None
        self._expected: Scene | None = None
        self._regions: Scalars | None = None
        self._best = np.inf
        self.without = 0  # pushes in a row without progress
        self.last: LastPush | None = None

    def expect(self, scene: Scene, predicted: Scene, regions: Scalars | None = None) -> None:
        """Take note that the scene (N, 8) that a push leads from should become another.

        `regions` (N,) [m] are the radii of the regions that should hold the disks, where known.
        """
        self._before, self._expected, self._regions = scene.copy(), predicted.copy(), regions

    def look(self, scene: Scene, rest_cost: float) -> None:
        """Take note of the scene (N, 8) that there is now, and of what staying there would cost."""
        before, expected = self._before, self._expected
        self.last = None
        pushed = before is not None and not np.array_equal(scene, before)
        if pushed and expected is not None and before is not None:
            if scene.shape == expected.shape:
                self.last = self._compare(before, expected, scene)
            self.without += 1
        if rest_cost < NEARER * self._best:
            self.without, self._best = 0, rest_cost

    def _compare(self, before: Scene, expected: Scene, scene: Scene) -> LastPush:
        errors = np.linalg.norm((scene - expected)[:, POSITION], axis=1)
        way = np.linalg.norm((expected - before)[:, POSITION], axis=1)
        band = np.maximum(self._config.surprise, self._config.surprise_share * way)
        if self._regions is not None:
            band = np.maximum(band, self._regions)
        return LastPush(errors, band)

    @property
    def concern(self) -> str:
        """Why to look further about than usual; empty: there is no reason to."""
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
