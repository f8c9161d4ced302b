"""Learns gym-pusht's physics from pushes made there: prior first, then a network on top."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich.console import Console

from sain_core.model import Model
from sain_core.provenance import ros2_command
from sain_core.scene import POSITION, THETA, wrap_angle
from sain_core.storage import make_folder
from sain_core.types import Mask
from sain_model.data.dataset import Dataset, Part, Split, split_by_episode
from sain_model.dynamics.checkpoint import ModelCard, save_checkpoint
from sain_model.dynamics.priors import prior_settings
from sain_model.dynamics.sain import SainDynamics
from sain_model.dynamics.settings import PLANAR
from sain_model.network.interaction_network import new_network
from sain_model.network.settings import PUSH_FRAME, NetworkConfig
from sain_model.training.objectives import SinglePushes
from sain_model.training.settings import NOTHING, LossConfig, TrainingConfig
from sain_model.training.trainer import Trainer
from sain_model.training.training_card import environment
from sain_pusht.agent import WALLS, pusht_agent
from sain_pusht.block import pusht_bodies
from sain_pusht.collecting import data_set, played_pushes, random_pushes
from sain_pusht.identification import Identified, identify, textbook
from sain_pusht.model import CHECKPOINT, GYRATION
from sain_pusht.options import LearnOptions
from sain_pusht.world import PushtWorld

NETWORK: Final = NetworkConfig(features=PUSH_FRAME, members=3, hidden=64, message=32, layers=2)
LOSS: Final = LossConfig(position_scale=0.0002, heading_scale=0.002)
FITTED_BY: Final = 600  # pushes that the prior is fitted to

Say = Callable[[str], None]


@dataclass(frozen=True)
class Lesson:
    """How much is collected and learned."""

    random_episodes: int
    played_episodes: int
    epochs: int


def run(options: LearnOptions, console: Console) -> None:
    """Collect, learn, and write the checkpoint."""
    lesson = Lesson(options.random_episodes, options.played_episodes, options.epochs)
    learn(lesson, make_folder(options.out), lambda text: console.print(text, highlight=False))


def learn(lesson: Lesson, out: Path, say: Say) -> SainDynamics:
    """Collect, identify, train, and write ``pusht.safetensors`` with its card into a folder.

    The network learns from pushes far from the walls: it does not see them.
    """
    split, known = collect(lesson, say)
    config = TrainingConfig(
        epochs=lesson.epochs,
        network=NETWORK,
        loss=LOSS,
        weight_decay=0.01,
        prior=PLANAR,
        history=NOTHING,
    )
    taught = replace(split, train=_far(split.train), validation=_far(split.validation))
    network = new_network(config.network, config.seed)
    lessons = SinglePushes(taught, known.prior, None, config)
    Trainer(network, lessons, config, out / "training.pt").run(
        lambda epoch, past: say(f"epoch {epoch}: {past.train[-1]:.3f} {past.validation[-1]:.3f}")
    )
    bodies = pusht_bodies(known.gyration)
    sain = SainDynamics(network, known.prior, PLANAR).with_bodies(bodies)
    models: dict[str, Model] = {
        "textbook": textbook().prior,
        "identified": known.prior,
        "network": sain,
    }
    report = {name: accuracy(model, split.test.alike) for name, model in models.items()}
    for name, row in report.items():
        say(f"{name}: {row}")
    card = replace(_card(sain, known, report), data=_data(known, taught), training=asdict(config))
    save_checkpoint(out / CHECKPOINT.name, sain.network, card)
    return sain


def _far(data: Dataset) -> Dataset:
    return data.select(far_from_walls(data.alike))


def _data(known: Identified, split: Split) -> dict[str, Any]:
    counts = {name: len(part) for name, part in vars(split).items()}
    return {GYRATION: known.gyration, "transitions": counts, "sha256": split.train.sha256}


def _card(sain: SainDynamics, known: Identified, report: dict[str, Any]) -> ModelCard:
    return ModelCard(
        PLANAR,
        prior_settings(known.prior),
        {},
        kind=sain.kind,
        errors=report,
        versions=environment(),
        command=ros2_command("sain_pusht", "learn"),
    )


def collect(lesson: Lesson, say: Say) -> tuple[Split, Identified]:
    """Return pushes, split by episode, and the prior that they tell of.

    The prior is fitted to random pushes first; then an agent plays with it.
    """
    world = PushtWorld()
    rows = list(random_pushes(lesson.random_episodes, world))
    say(f"{len(rows)} random pushes")
    known = identify(data_set(rows[:FITTED_BY], pusht_bodies()).alike)
    say(f"identified: {known}")
    world = PushtWorld(bodies=known.prior.bodies)
    rollout = known.prior
    first = 2 * rows[-1][3]
    played = played_pushes(
        lesson.played_episodes, world, lambda: pusht_agent(rollout, rollout), first
    )
    rows += list(played)
    say(f"{len(rows)} pushes with those in play")
    return split_by_episode(data_set(rows, world.bodies), 0, 0.1, 0.15), known


def accuracy(model: Model, data: Part) -> dict[str, Any]:
    """Return median, mean and 95th percentile of the errors, far from the walls and everywhere."""
    off = model.step(data.state, data.action) - data.next_state
    mm = 1e3 * np.linalg.norm(off[:, 0, POSITION], axis=-1)
    deg = np.degrees(np.abs(wrap_angle(off[:, 0, THETA])))
    far = far_from_walls(data)
    return {
        part: {"pushes": int(rows.sum()), "mm": _spread(mm[rows]), "deg": _spread(deg[rows])}
        for part, rows in {"everywhere": np.ones_like(far), "far from walls": far}.items()
    }


def far_from_walls(data: Part) -> Mask:
    """Tell in which pushes (M,) the block's circumscribed circle stays within the walls."""
    places = np.stack([data.state, data.next_state])[:, :, 0]
    room = np.minimum(places[..., POSITION] - WALLS[0], WALLS[1] - places[..., POSITION])
    return np.asarray((room.min(axis=-1) >= places[..., -1]).all(axis=0))


def _spread(values: np.ndarray) -> list[float]:
    figures = np.median(values), values.mean(), np.quantile(values, 0.95)
    return [round(float(figure), 3) for figure in figures]
