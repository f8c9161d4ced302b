"""What a laboratory has and this example has not: a table, bodies on it, an arm and a camera.

The planar prior moves the bodies, with a friction that nobody else knows and with noise.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sain_core.config import MOST_SEED, Config, option
from sain_core.push import LENGTH, SPEED
from sain_core.randomness import generator
from sain_core.scene import POSE, THETA, move_apart
from sain_core.shapes.body_file import read_bodies
from sain_core.types import PushArray
from sain_core.world import ObservationConfig
from sain_model.physics.planar import PlanarConfig, PlanarPrior

RATE = 30.0  # [Hz], of the camera
SETTLING = 0.2  # [s], from the end of a push to rest


@dataclass(frozen=True)
class RobotConfig(Config):
    """The pretended laboratory."""

    bodies: str = option(str(Path(__file__).with_name("bodies.yaml")), "YAML file of the bodies")
    seed: int = option(0, "of all noise", minimum=0, maximum=MOST_SEED)
    friction: float = option(0.14, "between bodies and table", minimum=0.01, maximum=1.0)
    spread: float = option(0.05, "noise of each way, as a share of it", minimum=0.0, maximum=0.5)
    noise: str = option("0.0005,0.005", "noise of the camera: METRES,RADIANS")
    pace: float = option(
        1.0, "how many times as fast as asked the tool moves", minimum=0.05, maximum=50.0
    )


class PretendTable:
    """Bodies that only the camera sees."""

    def __init__(self, config: RobotConfig) -> None:
        """Put the bodies in a row."""
        self.config, self.file = config, read_bodies(Path(config.bodies))
        self.bodies = self.file.bodies
        self._physics = PlanarPrior(PlanarConfig(friction=config.friction), self.bodies)
        self._random = generator(config.seed, "my_robot")
        self._noise = ObservationConfig(noise=config.noise).noise_std
        places = np.arange(len(self.bodies))
        self.set_up(np.stack([0.42 + 0.18 * places, 0.05 * places, 0.0 * places], axis=1))

    def set_up(self, poses: np.ndarray) -> None:
        """Put the bodies to poses (N, 3), as a person does."""
        self.scene = self._start = self.file.scene(poses)
        self._way = np.zeros_like(poses)
        self._began, self._duration = 0.0, 1.0

    def push(self, push: PushArray, now: float) -> float:
        """Begin to push at a time [s]; return when bodies will rest."""
        after = self._physics.step(self.scene[None], push[None])[0]
        way = after[:, POSE] - self.scene[:, POSE]
        way *= 1.0 + self.config.spread * self._random.standard_normal((len(way), 1))
        self._start, self._way, self._began = self.scene, way, now
        self._duration = max(float(push[LENGTH] / (self.config.pace * push[SPEED])), 0.1)
        return now + self._duration + SETTLING

    def look(self, now: float) -> np.ndarray:
        """Return the poses (N, 3) as the camera sees them at a time [s]."""
        share = float(np.clip((now - self._began) / self._duration, 0.0, 1.0))
        scene = self._start.copy()
        scene[:, POSE] += share * self._way
        self.scene = move_apart(scene) if self.bodies.all_round else scene
        seen = self.scene[:, POSE].copy()
        place, turn = self._noise
        seen[:, :THETA] += place * self._random.standard_normal((len(seen), 2))
        seen[:, THETA] += turn * self._random.standard_normal(len(seen))
        return seen
