"""How many workers there are, and where."""

from dataclasses import dataclass

from sain_core.config import Config, option


@dataclass(frozen=True, kw_only=True)
class WorkerOptions(Config):
    """Who does the work. What is written does not depend on it."""

    workers: int = option(
        1,
        "processes that share the work; planning takes longer with more of them than cores",
        minimum=1,
        maximum=4096,
    )
    ray: str = option(
        "",
        "Ray cluster of the workers: HOST:PORT; auto: this machine's; local: a new one on this"
        " machine",
    )
