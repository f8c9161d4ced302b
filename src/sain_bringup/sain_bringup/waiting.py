"""What the commands have in common that ask a running graph for something."""

from dataclasses import dataclass

from sain_core.config import Config, option


@dataclass(frozen=True)
class WaitOptions(Config):
    """How long a command waits for the nodes that it needs."""

    timeout: float = option(10.0, "longest wait for the nodes that it needs", unit="s", minimum=0.0)
