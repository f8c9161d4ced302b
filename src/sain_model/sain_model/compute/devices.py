"""Where a network runs: on a GPU when there is one, on the CPU otherwise, or as one says."""

from typing import Final

from sain_core.errors import ConfigError

AUTO: Final = "auto"
CPU: Final = "cpu"
CUDA: Final = "cuda"
DEVICES: Final = (AUTO, CPU, CUDA)


def choose_device(wanted: str) -> str:
    """Return the device, ``cpu`` or ``cuda``, for what is wanted, one of `DEVICES`.

    Raises:
        ConfigError: a GPU is wanted and PyTorch finds none, or no such device is known.
    """
    if wanted not in DEVICES:
        raise ConfigError(f"device is {wanted!r}; allowed: {', '.join(DEVICES)}")
    if wanted == CPU:
        return CPU
    import torch  # takes a second, which nothing that only names devices should wait

    found = torch.cuda.is_available()
    if wanted == CUDA and not found:
        raise ConfigError("device is 'cuda', but PyTorch finds no GPU; 'auto' would take the CPU")
    return CUDA if found else CPU
