"""What an ensemble is worth: its errors, how often its regions hold, what its disagreement tells.

./env python -m benchmarks.ensembles data/rough --features world --batch 64 --epochs 85 \
    --history none --transitions 3000 --outside data/wide_rough --out runs/ensembles/rough
./env python -m benchmarks.ensembles data/randomised --prior planar_axes --position-scale 0.0002 \
    --heading-scale 0.01 --epochs 60 --hidden 128 --weight-decay 0.01 --transitions 3000 \
    --seeds 0 1 --outside data/wide_ensembles --out runs/ensembles/randomised

For each seed, of the split and of the weights: one network, an ensemble whose members see the data
in different orders, and one whose members see different episodes. Run it again to go on after a
stop.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
import tyro
from rich.console import Console

from sain_core.bootstrap import bootstrap_ratio
from sain_core.scene import TARGET
from sain_core.seeding import generator
from sain_core.storage import write_json
from sain_model.data.dataset import (
    Dataset,
    Part,
    Split,
    limit_training,
    load_dataset,
    split_by_episode,
)
from sain_model.dynamics.sain import SainDynamics
from sain_model.evaluation.errors import TARGETS, evaluate, position_errors
from sain_model.evaluation.predictors import SAIN, SAIN_HISTORY, predict_with_history
from sain_model.network.features import count_features
from sain_model.network.interaction_network import InteractionNetwork, ensemble
from sain_model.network.settings import BOOTSTRAP, ORDER
from sain_model.training.fit import fit, trained_kind
from sain_model.training.settings import TrainingConfig

PATIENCES = (3, 5, 10, 20)
BATCHES = (64, 256, 1024, 4096)
CALLS = 30


@dataclass(frozen=True)
class Command:
    """What to train on, and how."""

    dataset: Annotated[Path, tyro.conf.Positional]
    """A collection."""
    out: Path
    """Folder of the states and of the report."""
    outside: Path | None = None
    """A collection outside of the training ranges."""
    size: int = 5
    """Members of the ensembles."""
    seeds: tuple[int, ...] = (0, 1, 2)
    """Of splits and trainings."""
    training: TrainingConfig = TrainingConfig()


def main() -> None:
    """Train, measure, and print a table."""
    torch.set_num_threads(1)
    command = tyro.cli(Command, description=main.__doc__, config=(tyro.conf.OmitArgPrefixes,))
    speed = [forward_times(command, batch) for batch in BATCHES]
    data = load_dataset(command.dataset)
    outside = load_dataset(command.outside).alike if command.outside else None
    rows = []
    for seed in command.seeds:
        config = replace(command.training, seed=seed)
        split = split_by_episode(data, seed, config.validation, config.test)
        if config.transitions:
            split = limit_training(split, config.transitions)
        alone: np.ndarray | None = None
        for members, diversity in ((1, ORDER), (command.size, ORDER), (command.size, BOOTSTRAP)):
            row, errors = measure(command, with_members(config, members, diversity), split, outside)
            alone = errors if alone is None else alone
            row["to one network"] = bootstrap_ratio(
                errors, alone, generator(0, "ratio"), split.test.episode
            )
            rows.append(row)
            show(row)
            report = {"dataset": str(command.dataset), "sha256": data.sha256, "speed": speed}
            report["rows"] = rows
            write_json(command.out / "report.json", report)


def forward_times(command: Command, batch: int) -> dict[str, float]:
    """Return the processor times [ms] of one network, an ensemble, and its members in a loop."""
    config = command.training.network
    lone = [InteractionNetwork(config) for _ in range(command.size)]
    together = ensemble(lone)
    inputs = tuple(torch.randn(batch, 2, count) for count in count_features(config))
    calls: dict[str, Callable[[], object]] = {
        "one": lambda: lone[0](*inputs),
        "ensemble": lambda: together(*inputs),
        "loop": lambda: [network(*inputs) for network in lone],
    }
    times = {"batch": float(batch)}
    for name, call in calls.items():
        with torch.inference_mode():
            call()
            begun = time.process_time()
            for _ in range(CALLS):
                call()
        times[name] = 1e3 * (time.process_time() - begun) / CALLS
    told = ", ".join(f"{name} {value:.2f} ms" for name, value in times.items() if name != "batch")
    Console(highlight=False).print(f"forward of {batch} pushes: {told}")
    return times


def with_members(config: TrainingConfig, members: int, diversity: str) -> TrainingConfig:
    """Return settings of so many members."""
    network = replace(config.network, members=members)
    return replace(config, network=network, diversity=diversity)


def measure(
    command: Command, config: TrainingConfig, split: Split, outside: Part | None
) -> tuple[dict[str, Any], np.ndarray]:
    """Train one model; return what was found of it and its target errors (M,) [mm] on test."""
    members, diversity = config.network.members, config.diversity
    folder = command.out / f"{members}-{diversity}-{config.seed}"
    sain, validation, seconds = trained(config, split, folder)
    errors, disagreement = judged(sain, split.test.alike)
    row: dict[str, Any] = {
        "members": members,
        "diversity": diversity,
        "seed": config.seed,
        "seconds": seconds,
        "target_mean": float(errors.mean()),
        "members_mean": disagreement,
        "intervals": regions_of(sain, split.test, config.seed),
        "early_stop": {patience: stopped(validation, patience) for patience in PATIENCES},
    }
    if outside is not None:
        row["outside"] = regions_of(sain, Dataset((outside,)), config.seed)
        far, row["outside_members_mean"] = judged(sain, outside)
        row["outside_mean"] = float(far.mean())
    return row, errors


def trained(
    config: TrainingConfig, split: Split, folder: Path
) -> tuple[SainDynamics, list[float], float]:
    """Return the model, its validation losses, and the processor time of its training [s]."""
    kind = trained_kind(config)
    begun = time.process_time()
    sain, (history,) = fit(split, kind, config, folder)
    return sain, history.validation, time.process_time() - begun


def regions_of(sain: SainDynamics, data: Dataset, seed: int) -> dict[str, Any]:
    """Return how often regions hold the target, by group, and rank correlations of its errors."""
    found = evaluate(data, {SAIN: sain}, seed=seed)
    name = SAIN_HISTORY if SAIN_HISTORY in found["rank_correlation"] else SAIN
    errors = found["after"]["1"]["errors"]
    held = {group: one[name]["coverage"][0] for group, one in errors.items() if name in one}
    return {"held": held, "rank_correlation": found["rank_correlation"][name]}


def judged(sain: SainDynamics, data: Part) -> tuple[np.ndarray, float]:
    """Return how far off the target is predicted with the episode's earlier pushes, (M,) [mm].

    And by how much the members disagree about it, on average [mm].
    """
    prediction = predict_with_history(sain, data)
    errors = position_errors(prediction.mean, data.next_state, TARGET)
    return errors, 1e3 * float(prediction.members[:, TARGET].mean())


def stopped(validation: list[float], patience: int) -> tuple[float, float]:
    """Return which share of the epochs patience saves, and the share of loss that it costs."""
    best = 0
    for epoch, loss in enumerate(validation):
        best = epoch if loss < validation[best] else best
        if epoch - best >= patience:
            break
    return 1.0 - (epoch + 1) / len(validation), validation[best] / min(validation) - 1.0


def show(row: dict[str, Any]) -> None:
    """Print one model's row."""
    held, ranks = row["intervals"]["held"], row["intervals"]["rank_correlation"]
    thirds = " / ".join(
        f"{100 * share:.1f}" for name, share in held.items() if name.endswith("by spread")
    )
    told = ", ".join(f"{name} {value:.2f}" for name, value in ranks.items())
    low, high = row["to one network"][1:]
    Console(width=160, highlight=False).print(
        f"{row['members']} {row['diversity']} seed {row['seed']}: {row['target_mean']:.4f} mm"
        f" ({row['to one network'][0]:.3f} [{low:.3f}, {high:.3f}]), {row['seconds']:.0f} s;"
        f" held {100 * held[TARGETS]:.1f} % ({thirds}); rank {told}",
    )
    if "outside" in row:
        far = row["outside"]
        Console(width=160, highlight=False).print(
            f"  outside: {row['outside_mean']:.3f} mm, held"
            f" {100 * far['held'][TARGETS]:.1f} %, members disagree in"
            f" {row['outside_members_mean']:.3f} mm where it was {row['members_mean']:.3f}; rank"
            f" {far['rank_correlation'].get('members', 0.0):.2f}"
        )


if __name__ == "__main__":
    main()
