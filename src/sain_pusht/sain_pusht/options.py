"""Options of the commands for gym-pusht; they load without it and without PyTorch."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from sain_core.config import Config, option, required
from sain_core.workers.running import WorkerOptions
from sain_mppi.algorithms.config import PlannerConfig
from sain_pusht.agent import PLANNER


@dataclass(frozen=True)
class PushtOptions(WorkerOptions):
    """Play Push-T in gym-pusht: its physics, seeds, steps and measure of success.

    The agent is the one that sain_eval's evaluate and mppi_node run. An episode ends when gym-pusht
    says so, after 300 steps at the latest. After a stop, the same command continues.
    """

    out: Path = option(
        Path("results/pusht"),
        "folder for results.json, table.md, episodes.jsonl and episode.gif; made if need be",
    )
    episodes: int = option(500, "episodes to play", minimum=1)
    seed: int = option(0, "seed of the first episode; the next ones have the next seeds", minimum=0)
    model: str = option(
        "pusht",
        "what plans: pusht, the shipped model; prior, its physics alone; oracle, gym-pusht's own"
        " physics; or a name or path as in sain_eval's evaluate",
    )
    film: bool = option(True, "write the first episode as episode.gif")
    planner: Annotated[PlannerConfig, tyro.conf.arg(help="How the agent plans.")] = field(
        default_factory=lambda: PLANNER
    )


@dataclass(frozen=True)
class LearnOptions(Config):
    """Learn gym-pusht's physics from pushes made there: prior, then a network on top.

    Writes pusht.safetensors and its card, and prints the errors on pushes of other episodes.
    """

    out: Path = required("folder for the checkpoint; made if need be")
    random_episodes: int = option(250, "episodes of random pushes", minimum=20)
    played_episodes: int = option(150, "episodes that the agent plays", minimum=1)
    epochs: int = option(40, "passes over the data", minimum=1)
