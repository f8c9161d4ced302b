"""The network of SAIN, run compiled: what it adds to what the physics leaves."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.push import LENGTH, pushed_bodies
from sain_core.scene import POSITION
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.shapes.shape import BOTTOMS
from sain_core.types import Pushes, Scenes
from sain_model.compute.compiling import plain
from sain_model.compute.kernel_store import compile_visibly
from sain_model.compute.threads import run_blocks
from sain_model.dynamics.intervals import Intervals, Prediction
from sain_model.network.feature_kernels import LANES
from sain_model.network.features import elongations, network_beliefs, outline_table, push_frames
from sain_model.network.network_kernels import PackedWeights, correct_block
from sain_model.network.settings import WORLD_FRAME
from sain_model.network.weights import NetworkWeights
from sain_model.physics.parameters import Values


class PhysicsPrediction(NamedTuple):
    """What physics predicts for B pushes: what a network corrects."""

    scenes: Scenes  # before the pushes (B, N, 8), with masses as the physics takes them to be
    pushes: Pushes  # (B, A)
    after: Scenes  # (B, N, 8), what physics predicts
    bodies: Bodies = PAPER_DISKS  # of the scenes
    # what is believed of the physics, by name; nothing for a network that does not see it
    values: Values = {}  # noqa: RUF012 - nobody changes it


@dataclass(frozen=True, eq=False)
class ResidualNetwork:
    """f_theta of the paper's equation 2, and regions about its predictions.

    Kernels compute it on all of Numba's threads. They agree with PyTorch's forward pass, which is
    trained, to single precision, and with themselves to the bit: on any number of threads, and for
    a push alone or in any batch.
    """

    weights: NetworkWeights  # the trained weights
    intervals: Intervals | None = None  # the regions of predictions; None: they were not fitted
    # of the bodies that it learned from; for others physics predicts
    bottoms: tuple[str, ...] = BOTTOMS

    @cached_property
    def _packed(self) -> PackedWeights:
        compile_visibly()
        return self.weights.pack()

    @cached_property
    def _each(self) -> list[Self]:
        """Each member of the ensemble alone."""
        members = range(self.weights.config.members)
        return [replace(self, weights=self.weights.member(number)) for number in members]

    def knows(self, bodies: Bodies) -> bool:
        """Return whether it learned from bodies on such bottoms."""
        return all(shape.bottom in self.bottoms for shape in bodies.shapes)

    def correct(self, physics: PhysicsPrediction) -> Scenes:
        """Return what physics predicts (B, N, 8), corrected.

        A push of zero length moves nothing, nor does a body with the role "fixed". Velocities,
        masses and radii are passed on as they are.
        """
        corrected = self._corrected(physics)
        if fixed := list(physics.bodies.fixed):
            corrected[:, fixed] = physics.after[:, fixed]
        return corrected

    def _corrected(self, physics: PhysicsPrediction) -> Scenes:
        scenes, pushes, after, bodies, values = physics
        corrected = np.array(after, dtype=np.float64, order="C")
        frames, config = push_frames(scenes, pushes, bodies), self.weights.config
        rows = plain(scenes), plain(frames)
        believed = plain(network_beliefs(config, scenes, frames, values))
        table, places = (
            outline_table(bodies.fitted(scenes.shape[1])),
            config.features == WORLD_FRAME,
        )
        packed = self._packed

        def work(first: int) -> None:
            correct_block(first, *rows, corrected, believed, table, places, packed)

        run_blocks(work, len(scenes), LANES)
        return corrected

    def spread(self, physics: PhysicsPrediction) -> Float[ndarray, "B N"]:
        """Return the standard deviation of the members' places [m]; 0 for a lone network."""
        if self.weights.config.members == 1:
            return np.zeros(physics.scenes.shape[:2])
        places = np.stack([network._corrected(physics)[..., POSITION] for network in self._each])
        spread = np.sqrt(places.var(axis=0, ddof=1).sum(axis=-1))
        return np.where(physics.pushes[:, LENGTH, None] == 0.0, 0.0, spread)

    def with_regions(
        self, prediction: Prediction, scenes: Scenes, pushes: Pushes, bodies: Bodies
    ) -> Prediction:
        """Return a prediction with the regions of bodies; without, where none were fitted."""
        if self.intervals is None:
            return prediction
        long = elongations(bodies.fitted(scenes.shape[1]))
        return self.intervals.about(prediction, scenes, pushed_bodies(pushes), long)
