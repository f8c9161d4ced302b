"""``ros2 run sain_pusht learn``: gym-pusht's physics from pushes made there.

The prior is fitted first; then a network learns what it leaves.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from rich.console import Console

from sain_core.config import Config, option, required
from sain_core.model import Model
from sain_core.output import OVERWRITE_HELP, claim_folder
from sain_core.provenance import ros2_command
from sain_core.scene import POSITION, THETA, wrap_angle
from sain_core.types import Mask
from sain_model.network.settings import PLANAR, PUSH_FRAME, NetworkConfig
from sain_model.training.settings import NOTHING, LossConfig, TrainingConfig
from sain_pusht.agent import WALLS, pusht_agent
from sain_pusht.block import pusht_bodies
from sain_pusht.world import PushtWorld

if TYPE_CHECKING:
    from sain_model.data.dataset import Dataset, Part, Split
    from sain_pusht.identification import Identified

NETWORK: Final = NetworkConfig(features=PUSH_FRAME, members=3, hidden=64, message=32, layers=2)
LOSS: Final = LossConfig(position_scale=0.0002, heading_scale=0.002)
FITTED_BY: Final = 600  # pushes that the prior is fitted to

Say = Callable[[str], None]


@dataclass(frozen=True)
class LearnOptions(Config):
    """Learn gym-pusht's physics from pushes made there: prior, then a network on top.

    Writes pusht.safetensors and its card, and prints the errors on pushes of other episodes.
    """

    out: Path = required("folder for the checkpoint; made if need be")
    overwrite: bool = option(False, OVERWRITE_HELP)
    random_episodes: int = option(250, "episodes of random pushes", minimum=20)
    played_episodes: int = option(150, "episodes that the agent plays", minimum=1)
    epochs: int = option(40, "passes over the data", minimum=1)


def run(options: LearnOptions, console: Console) -> None:
    """Collect, fit, train, and write ``pusht.safetensors`` with its card into a folder.

    The network learns from pushes far from the walls: walls are none of its inputs.
    """
    from sain_model.dynamics.load import ModelCard, save_checkpoint
    from sain_model.dynamics.priors import prior_settings
    from sain_model.dynamics.residual import residual_model
    from sain_model.inference.kinds import friction_kind
    from sain_model.network.interaction_network import new_network
    from sain_model.training.fit import STATES
    from sain_model.training.objectives import SinglePushes
    from sain_model.training.record import environment
    from sain_model.training.trainer import Trainer
    from sain_pusht.identification import textbook
    from sain_pusht.model import CHECKPOINT, GYRATION

    names = CHECKPOINT.name, CHECKPOINT.with_suffix(".json").name, STATES[0]
    out = claim_folder(options.out, names, options.overwrite)

    def say(text: str) -> None:
        console.print(text, highlight=False)

    split, fitted = collect(options.random_episodes, options.played_episodes, say)
    far = replace(split, train=_far(split.train), validation=_far(split.validation))
    config = TrainingConfig(
        epochs=options.epochs,
        network=NETWORK,
        loss=LOSS,
        weight_decay=0.01,
        prior=PLANAR,
        history=NOTHING,
    )
    kind = friction_kind(fitted.prior, infers=False)
    network = new_network(config.network, config.seed)
    objective = SinglePushes(far, kind, config)
    Trainer(network, objective, config, out / STATES[0], overwrite=options.overwrite).run(
        lambda epoch, past: say(f"epoch {epoch}: {past.train[-1]:.3f} {past.validation[-1]:.3f}")
    )
    sain = residual_model(network, kind, PLANAR)
    models: dict[str, Model] = {
        "textbook": textbook().prior,
        "identified": fitted.prior,
        "network": sain.with_bodies(pusht_bodies(fitted.gyration)),
    }
    report = {name: accuracy(model, split.test.alike) for name, model in models.items()}
    for name, row in report.items():
        say(f"{name}: {row}")
    counts = {name: len(part) for name, part in vars(far).items()}
    card = ModelCard(
        PLANAR,
        prior_settings(fitted.prior),
        {},
        kind=sain.origin.kind,
        data={GYRATION: fitted.gyration, "transitions": counts, "sha256": far.train.sha256},
        training=asdict(config),
        errors=report,
        versions=environment(),
        command=ros2_command("sain_pusht", "learn"),
    )
    save_checkpoint(out / CHECKPOINT.name, network, card)


def _far(data: "Dataset") -> "Dataset":
    return data.select(far_from_walls(data.alike))


def collect(random: int, played: int, say: Say) -> "tuple[Split, Identified]":
    """Return pushes of so many episodes, split by episode, and the prior fitted to them.

    It is fitted to random pushes first; then an agent plays with it.
    """
    from sain_model.data.dataset import split_by_episode
    from sain_pusht.identification import data_set, identify, played_pushes, random_pushes

    rows = list(random_pushes(random, PushtWorld()))
    say(f"{len(rows)} random pushes")
    fitted = identify(data_set(rows[:FITTED_BY], pusht_bodies()).alike)
    say(f"identified: {fitted}")
    world, prior = PushtWorld(fitted.prior.bodies), fitted.prior
    rows += played_pushes(played, world, lambda: pusht_agent(prior, prior), 2 * rows[-1][3])
    say(f"{len(rows)} pushes with those in play")
    return split_by_episode(data_set(rows, world.bodies), 0, 0.1, 0.15), fitted


def accuracy(model: Model, data: "Part") -> dict[str, Any]:
    """Return median, mean and 95th percentile of the errors, far from the walls and everywhere."""
    off = model.step(data.state, data.action) - data.next_state
    mm = 1e3 * np.linalg.norm(off[:, 0, POSITION], axis=-1)
    deg = np.degrees(np.abs(wrap_angle(off[:, 0, THETA])))
    far = far_from_walls(data)
    return {
        part: {"pushes": int(rows.sum()), "mm": _spread(mm[rows]), "deg": _spread(deg[rows])}
        for part, rows in {"everywhere": np.ones_like(far), "far from walls": far}.items()
    }


def far_from_walls(data: "Part") -> Mask:
    """Tell in which pushes (M,) the block's circumscribed circle stays within the walls."""
    places = np.stack([data.state, data.next_state])[:, :, 0]
    room = np.minimum(places[..., POSITION] - WALLS[0], WALLS[1] - places[..., POSITION])
    return np.asarray((room.min(axis=-1) >= places[..., -1]).all(axis=0))


def _spread(values: np.ndarray) -> list[float]:
    figures = np.median(values), values.mean(), np.quantile(values, 0.95)
    return [round(float(figure), 3) for figure in figures]
