"""What is served, and how much is accepted; importable without the model."""

from dataclasses import dataclass

from sain_core.config import Config, option
from sain_core.world import unknown_names


@dataclass(frozen=True)
class ServingConfig(Config):
    """What is served."""

    model: str = option(
        "sain", "name in the registry of models, or the path of a checkpoint", live=True
    )
    belief: str = option(
        "", "file of `sain_model identify`, with which each episode begins; empty: none"
    )
    unknown: str = option("", "quantities that scenes give as nominal, separated by commas: mass")
    max_work: int = option(
        2_000_000, "largest samples x horizon x disks of a request", minimum=1, maximum=2**40
    )
    max_disks: int = option(32, "largest number of disks of a scene", minimum=2, maximum=1024)
    max_queue: int = option(
        1000, "largest number of waiting requests; others are refused", minimum=1
    )
    state_file: str = option(
        "", "file that keeps the name of the model, to resume after a crash; empty: none"
    )
    service_introspection: str = option(
        "disabled",
        "published service events: none, metadata, or requests and replies too",
        choices=("disabled", "metadata", "contents"),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        unknown_names(self.unknown)
