"""How a world is seen: late, with noise and bias, without masses and radii; as a camera is set.

All randomness has names: an episode's seed, and the number of a frame. So an episode is seen with
the same errors in the graph and in an evaluation, in all engines.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.config import option
from sain_core.randomness import generator
from sain_core.scene import MASS, NOMINAL_MASS, POSE, THETA, VELOCITY, wrap_angle
from sain_core.types import Scene
from sain_core.world import MASSES, ObservationConfig
from sain_sim.world.parameters import WorldParameters

PoseErrors = Float[ndarray, "N 3"]  # [m, m, rad]


@dataclass(frozen=True)
class WorldCameraConfig(ObservationConfig):
    """How bodies are observed."""

    frame_rate: float = option(
        30.0,
        "frames per simulated second, unless observations are exact",
        unit="Hz",
        minimum=1.0,
        maximum=240.0,
    )


@dataclass(frozen=True)
class CameraFrame:
    """A scene (N, 8) as it was seen, and the time [s] of the observation, not of its arrival."""

    scene: Scene
    time: float


class Camera:
    """Sees the scenes of one episode after another."""

    def __init__(self, config: WorldCameraConfig) -> None:
        """Begin without an episode."""
        self.config = config
        self._under_way: deque[CameraFrame] = deque()
        self._latest: CameraFrame | None = None

    @property
    def period(self) -> float:
        """Time from frame to frame [s]."""
        return 1.0 / self.config.frame_rate

    def begin(self, seed: int, parameters: WorldParameters) -> None:
        """Begin an episode with this seed; frames that have not arrived are lost."""
        self._seed, self._scene, self._frame = seed, 0, 0
        self._under_way.clear()
        self._latest = None
        random = generator(seed, "camera", "bias")
        self._bias = _errors(random, parameters.count, self.config.bias_std)

    def count_push(self) -> None:
        """Take note that a push was executed: the next frames at rest show another scene."""
        self._scene, self._frame = self._scene + 1, 0

    def observe(self, scene: Scene, time: float, moving: bool = False) -> None:
        """Observe a scene (N, 8) at a time [s]; it arrives later."""
        self._frame += 1
        path = ("camera", "moving" if moving else "rest", self._scene, self._frame)
        noise = _errors(generator(self._seed, *path), len(scene), self.config.noise_std)
        seen = self.measured(scene)
        seen[:, POSE] += noise + self._bias
        seen[:, THETA] = wrap_angle(seen[:, THETA])
        frame = CameraFrame(seen, time)
        self._set_speeds(frame)
        self._latest = frame
        self._under_way.append(frame)

    def arrived(self, now: float) -> list[CameraFrame]:
        """Return the frames that have arrived by now [s], the oldest first; each only once."""
        frames = []
        while self._under_way and self._under_way[0].time + self.config.delay <= now + 1e-9:
            frames.append(self._under_way.popleft())
        return frames

    def measured(self, scene: Scene) -> Scene:
        """Return a scene (N, 8) with nominal values in place of what is not measured."""
        seen = scene.copy()
        if MASSES in self.config.unknown_names:
            seen[:, MASS] = NOMINAL_MASS
        return seen

    def _set_speeds(self, frame: CameraFrame) -> None:
        """Set the velocities of a frame: differences to the one before it, or none."""
        last, frame.scene[:, VELOCITY] = self._latest, 0.0
        if last is not None and frame.time > last.time:
            way = (frame.scene - last.scene)[:, POSE]
            way[:, THETA] = wrap_angle(way[:, THETA])
            frame.scene[:, VELOCITY] = way / (frame.time - last.time)


def _errors(random: np.random.Generator, count: int, std: tuple[float, float]) -> PoseErrors:
    """Draw errors of so many poses."""
    return random.standard_normal((count, 3)) * np.array([std[0], std[0], std[1]])
