"""Settings of the model's service, importable without PyTorch."""

from dataclasses import dataclass

from sain_core.config import Config, option
from sain_model.compute.devices import AUTO, DEVICES


@dataclass(frozen=True)
class ServingConfig(Config):
    """What is served."""

    model: str = option(
        "sain", "name in the registry of models, or the path of a checkpoint", live=True
    )
    device: str = option(
        AUTO, "what the network runs on; auto: a GPU where there is one", choices=DEVICES
    )
    max_work: int = option(
        2_000_000, "largest samples x horizon x disks of a request", minimum=1, maximum=2**40
    )
    max_disks: int = option(
        32, "most disks of a scene: pairs grow with the square", minimum=2, maximum=1024
    )
    max_queue: int = option(1000, "requests that may wait; further ones are refused", minimum=1)
    service_introspection: str = option(
        "disabled",
        "publish what is asked of services and answered: not, when and by whom, or all of it",
        choices=("disabled", "metadata", "contents"),
    )
