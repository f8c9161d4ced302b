"""Learning curves: how many transitions a network needs, with physics under it and without."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from sain_core.errors import CheckpointError
from sain_core.guarding.untrusted import read_json
from sain_core.storage import write_json
from sain_model.data.dataset import Split, check_held_out, limit_training
from sain_model.dynamics.settings import IDENTITY
from sain_model.evaluation.errors import MM, TARGETS, evaluate
from sain_model.evaluation.predictors import (
    BULLET,
    FLOOR,
    LEARNED,
    MEASURED,
    NAMES,
    PLANAR_HISTORY,
    SAIN,
    SAIN_HISTORY,
)
from sain_model.training.fit import fit, trained_kind
from sain_model.training.settings import TrainingConfig

PHYSICS: Final = (BULLET, MEASURED, PLANAR_HISTORY, FLOOR)
NETWORKS: Final = (LEARNED, SAIN, SAIN_HISTORY)


@dataclass(frozen=True)
class Point:
    """The target's mean error of one predictor on held-out episodes, with 95 % interval [mm]."""

    name: str
    transitions: int  # that a network was trained on; 0 for physics
    mean: float
    low: float
    high: float


def learning_curve(
    split: Split,
    config: TrainingConfig,
    sizes: Sequence[int],
    steps: int,
    folder: Path,
    progress: Callable[[str, int], None] = lambda prior, size: None,
) -> list[Point]:
    """Train on more and more transitions, alone and on a prior, and measure on what is held out.

    Every network takes the same number of steps. What is done stays in the folder; a call that was
    stopped goes on from there.

    Args:
        split: sizes are taken from its training part.
        config: of every network, but for epochs and, for the network alone, the prior.
        sizes: numbers of transitions to train on.
        steps: of the optimiser.
        folder: for the state of each training, and its errors.
        progress: called with the prior and the size of each training that begins.

    Raises:
        DatasetError: a size that there are not so many transitions for, or nothing is held out.
        CheckpointError: the folder's state is damaged or of other settings or data.
    """
    check_held_out(split)
    points: dict[tuple[str, int], Point] = {}
    for size, part in [(size, limit_training(split, size)) for size in sizes]:
        for prior in (IDENTITY, config.prior):
            progress(prior, size)
            settings = replace(config, prior=prior, epochs=_epochs(config, size, steps))
            errors = _errors(part, settings, folder / f"{prior}-{size}")
            for name in (*PHYSICS, *NETWORKS):
                if row := errors.get(name):
                    trained = size if name in NETWORKS else 0
                    points[name, trained] = Point(name, trained, *row[MM])
    return list(points.values())


def _epochs(config: TrainingConfig, size: int, steps: int) -> int:
    return max(round(steps * config.batch / (size * (2 if config.mirrors else 1))), 1)


def _errors(split: Split, config: TrainingConfig, folder: Path) -> dict[str, dict[str, Any]]:
    """Return the errors on all held-out pushes by predictor; from the folder, if they are there."""
    path = folder / "errors.json"
    identity = f"{config} {split.train.sha256} {len(split.test)}"
    if path.exists():
        try:
            done = read_json(path)
            if done["identity"] != identity:
                raise CheckpointError(
                    f"{path} belongs to other settings or data; use another folder"
                )
            return dict(done["errors"])
        except (OSError, LookupError, TypeError, ValueError) as error:
            raise CheckpointError(f"{path} is damaged ({error}); use another folder") from error
    model, _ = fit(split, trained_kind(config), config, folder)
    errors = evaluate(split.test, {NAMES[model.origin.kind]: model})["after"]["1"]["errors"][
        TARGETS
    ]
    write_json(path, {"identity": identity, "errors": errors})
    return dict(errors)
