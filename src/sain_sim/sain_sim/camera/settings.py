"""When poses are old, at rest, or further apart than a body can move."""

from dataclasses import dataclass

from sain_core.config import Config, option
from sain_core.observation import ObservationConfig


@dataclass(frozen=True)
class TrackingConfig(Config):
    """How poses of bodies become scenes."""

    noise: str = option(
        "0,0",
        "standard deviation of the poses, as the planner's `estimator.noise`: METRES,RADIANS",
    )
    rest_time: float = option(
        0.3, "time without motion after which bodies are at rest", unit="s", minimum=0.05
    )
    rest_distance: float = option(
        0.0005, "motion in this time that counts as none, besides noise", unit="m", minimum=1e-5
    )
    rest_turn: float = option(0.005, "the same for headings", unit="rad", minimum=1e-4)
    max_speed: float = option(
        1.0, "fastest motion of a body; more is a jump", unit="m/s", minimum=0.01
    )
    max_spin: float = option(
        15.0, "fastest turn of a body; more is a jump", unit="rad/s", minimum=0.1
    )
    max_age: float = option(0.5, "age above which poses are not used", unit="s", minimum=0.02)
    push_timeout: float = option(
        60.0, "time after which a push without a result counts as lost", unit="s", minimum=1.0
    )

    def __post_init__(self) -> None:
        """Check the fields and the numbers in words."""
        super().__post_init__()
        ObservationConfig(noise=self.noise)

    @property
    def noise_std(self) -> tuple[float, float]:
        """The noise of a pose, [m] and [rad]."""
        return ObservationConfig(noise=self.noise).noise_std


@dataclass(frozen=True)
class PosesConfig(TrackingConfig):
    """What the converter of poses reads, and how often it publishes."""

    bodies: str = option("", "YAML file of the bodies: shape, role, radius, mass, frame")
    frame: str = option("world", "frame of the poses, whose z axis points up")
    rate: float = option(30.0, "most scenes per second", unit="Hz", minimum=1.0, maximum=240.0)
    peer_wait: float = option(
        1.0, "time to look for another publisher of scenes", unit="s", minimum=0.0, maximum=60.0
    )
    state_file: str = option("", "file that keeps the ids, which never count again; empty: none")
