r"""What is learned in a reality that nobody here made, from N pushes of it.

    collect() { nice ./env ros2 run sain_sim collect --engine mujoco --out data/foreign/"$@"; }
    collect train --episodes 480 --seed 301
    collect test --episodes 250 --seed 302
    nice ./env python -m benchmarks.foreign data/foreign/{train,test} --sizes 100 500 3000

Folders may also come from bags. Of the first pushes of the one, `identify` finds the physics, and
a network learns what that leaves. Errors are those of the target after one push of the other
folder, with the earlier pushes of its episode. Ratios have 95 % intervals over episodes. A sixth of
the episodes to learn from chooses the best epoch and fits the regions.

In closed loop, disks learn from bags as docs/explanation/identification.md shows, cubes and T by

    collect cubes --target cube --episodes 200 --seed 311
    collect ts --shapes t --bodies 1 --episodes 250 --seed 312
    nice ./env ros2 run sain_model identify data/foreign/{cubes,ts} --pushes 300 --out belief.json
    nice ./env ros2 run sain_model train data/foreign/{cubes,ts} --belief belief.json \
        --position-scale 0.0002 --heading-scale 0.01 --weight-decay 0.01 --batch 128 --epochs 40 \
        --members 2 --validation 0.15 --test 0 --out runs/foreign/shapes
    evaluate() {
        nice ./env ros2 run sain_eval evaluate --engine mujoco --scenes 100 --scenario "$1" \
            --controllers runs/foreign/shapes/sain.safetensors --tolerances "$2" --out "results/$1"
    }
    evaluate anywhere_cube 0.05,0.02,0.01,0.005
    evaluate push_t 0.05:0.2,0.02:0.1,0.01:0.05
"""

import argparse
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import torch

from sain_core.bootstrap import bootstrap_ratio
from sain_core.model import IdentityPrior
from sain_core.scene import TARGET
from sain_core.seeding import generator
from sain_core.types import Scalars, Scenes
from sain_model.data.dataset import Part, Split, load_dataset, split_by_episode
from sain_model.data.recordings import first_pushes, load_recording
from sain_model.dynamics.identify import identify
from sain_model.dynamics.load import load_shipped
from sain_model.dynamics.sain import SainDynamics
from sain_model.dynamics.settings import IDENTITY, PLANAR
from sain_model.evaluation.errors import position_errors
from sain_model.evaluation.predictors import predict_with_history, step_with_history
from sain_model.evaluation.tables import markdown_table
from sain_model.inference.kinds import Kind, friction_kind, only
from sain_model.network.settings import NetworkConfig
from sain_model.physics.planar import PlanarPrior
from sain_model.physics.planar_config import AXES, TEXTBOOK
from sain_model.training.fit import fit
from sain_model.training.settings import NOTHING, LossConfig, TrainingConfig

STEPS: Final = 5000  # of the optimizer, whatever the number of pushes
CONFIG: Final = TrainingConfig(
    batch=64,
    weight_decay=0.01,
    validation=1 / 6,
    test=0.0,
    network=NetworkConfig(members=3),
    loss=LossConfig(position_scale=0.0002, heading_scale=0.01),
)
COLUMNS: Final = ("pushes", "mean, mm", "to planar", "to textbook", "median", "regions hold")


@dataclass(frozen=True)
class Judge:
    """Held-out pushes, and the errors of physics that is fitted to nothing there."""

    test: Part
    planar: Scalars
    textbook: Scalars

    @classmethod
    def of(cls, test: Part) -> "Judge":
        """Return what judges by these pushes."""
        planar, textbook = (_physics(prior, test) for prior in (PlanarPrior(), _textbook()))
        return cls(test, planar, textbook)

    def row(self, name: str, errors: Scalars, pushes: int = 0, regions: str = "") -> list[str]:
        """Return a row of the table."""
        ones, episodes = np.ones(len(errors)), self.test.episode
        ratios = (
            bootstrap_ratio(errors, below, generator(0, "ratio"), episodes)
            for below in (ones, self.planar, self.textbook)
        )
        cells = ["{:.2f} [{:.2f}, {:.2f}]".format(*ratio) for ratio in ratios]
        return [name, f"{pushes or ''}", *cells, f"{np.median(errors):.2f}", regions]

    def model(self, name: str, model: SainDynamics, pushes: int = 0) -> list[str]:
        """Return the row of a model, with its regions."""
        prediction = predict_with_history(model, self.test)
        assert prediction.radius is not None
        errors = _off(prediction.mean, self.test)
        held = errors <= 1e3 * prediction.radius[:, TARGET]
        return self.row(name, errors, pushes, f"{100 * held.mean():.0f} %")


def main() -> None:
    """Learn from more and more pushes; print tables."""
    torch.set_num_threads(1)
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("train", type=Path)
    parser.add_argument("test", type=Path)
    parser.add_argument("--sizes", type=int, nargs="+", default=[3000])
    arguments = parser.parse_args()
    judge = Judge.of(load_dataset(arguments.test).alike)
    show(_unlearned(judge))
    for size in arguments.sizes:
        show(_learned(judge, arguments.train, size, alone=size == max(arguments.sizes)))


def show(rows: list[list[str]]) -> None:
    """Print rows as a table."""
    print(markdown_table(["prediction", *COLUMNS], rows), flush=True)


def _unlearned(judge: Judge) -> list[list[str]]:
    """Return the rows of what has seen nothing of this reality but earlier pushes."""
    test, plain = judge.test, PlanarPrior()
    return [
        judge.row("planar, no history", _off(plain.step(test.state, test.action), test)),
        judge.row("planar", judge.planar),
        judge.row("planar_axes", _physics(PlanarPrior(AXES), test)),
        judge.row("textbook", judge.textbook),
        judge.model("SAIN as shipped", load_shipped()),
    ]


def _learned(judge: Judge, folder: Path, size: int, alone: bool) -> list[list[str]]:
    """Return the rows of what is learned from the first pushes of a folder.

    With `alone`, also of a network without physics.
    """
    parts = first_pushes(load_recording(folder), size)
    pushes = sum(map(len, parts))
    data = load_dataset(folder)
    first = np.unique(data.episode)[: 1 + max(int(part.episode.max()) for part in parts)]
    split = split_by_episode(
        data.select(np.isin(data.episode, first)), CONFIG.seed, CONFIG.validation, CONFIG.test
    )
    found = identify(load_shipped(), {str(folder): parts}).likeliest
    kind = friction_kind(found.prior, deviation=float(found.deviations[0]))
    sain = _train(split, kind)
    test = judge.test
    truth = _off(sain.step(test.state, test.action, {"friction": test.friction}), test)
    rows = [
        judge.row(f"identified, {found.name}", _with_history(kind, test), pushes),
        judge.model("SAIN, learned there", sain, pushes),
        judge.row("the same, true friction", truth, pushes),
    ]
    if alone:
        network = _train(split, friction_kind(IdentityPrior()))
        rows.append(judge.model("learned only", network, pushes))
    return rows


def _train(split: Split, kind: Kind) -> SainDynamics:
    """Return a network on one kind of physics, with its regions."""
    per_epoch = max(2 * len(split.train) // CONFIG.batch, 1)
    named = PLANAR if kind.names else IDENTITY
    config = replace(
        CONFIG,
        prior=named,
        epochs=max(STEPS // per_epoch, 1),
        history=CONFIG.history if kind.names else NOTHING,
    )
    with tempfile.TemporaryDirectory() as out:
        model, _ = fit(split, kind, config, Path(out))
    return model


def _textbook() -> PlanarPrior:
    return PlanarPrior(replace(TEXTBOOK, friction=PlanarPrior().config.friction))


def _physics(prior: PlanarPrior, test: Part) -> Scalars:
    return _with_history(friction_kind(prior), test)


def _with_history(kind: Kind, test: Part) -> Scalars:
    """Return errors of physics with the friction that earlier pushes show."""
    return _off(step_with_history(SainDynamics(only(kind)), test), test)


def _off(predicted: Scenes, test: Part) -> Scalars:
    return position_errors(predicted, test.next_state, TARGET)


if __name__ == "__main__":
    main()
