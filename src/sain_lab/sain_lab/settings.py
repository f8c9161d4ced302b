"""The settings of the learner's node."""

from dataclasses import dataclass

from sain_core.config import Config, option
from sain_core.world import ObservationConfig
from sain_lab.storage.laboratory import laboratory_path


@dataclass(frozen=True)
class LearnerConfig(Config):
    """Where and from what the node learns."""

    laboratory: str = option(
        "", "name of the laboratory, or a path with a '/'; it is made where there is none"
    )
    learns: bool = option(
        True, "learn from results; off: the model in service stays as it is", live=True
    )
    trains: bool = option(True, "train networks; off: the physics alone is learned")
    noise: str = option(
        "0,0", "standard deviation of the places [m] and headings [rad] in results: METRES,RADIANS"
    )
    nice: int = option(10, "how far the priority is below that of the graph", minimum=0, maximum=19)
    state_file: str = option("", "file that keeps the name of the run over a crash; empty: none")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.laboratory:
            laboratory_path(self.laboratory)
        ObservationConfig(noise=self.noise)

    @property
    def place_noise(self) -> float:
        """The standard deviation of a place [m]."""
        return ObservationConfig(noise=self.noise).noise_std[0]
