"""Options of the commands; they load without PyTorch."""

import argparse
from dataclasses import dataclass, field, make_dataclass
from pathlib import Path
from typing import Annotated, Final

import tyro

from sain_core.config import Config, option, required
from sain_model.dynamics.settings import STEPS
from sain_model.network.inputs import MASS_MIDDLE
from sain_model.network.settings import PARAMETERS
from sain_model.training.settings import (
    DEFAULT,
    OF_PARAMETERS,
    PRESETS,
    TrainingConfig,
    TrainOptions,
)

DATASET: Final = "a shard *.npz, or a folder of them"


@dataclass(frozen=True)
class EvaluateModelOptions(Config):
    """Report errors of every kind of dynamics, one push and many ahead, on episodes held out."""

    dataset: Annotated[Path, tyro.conf.Positional] = required(DATASET)
    checkpoint: Path | None = option(None, "the checkpoint; by default the shipped one")
    beside: tuple[str, ...] = option(
        (),
        "more models to compare with: paths of checkpoints, such as one of --prior identity or"
        " --steps-ahead, or names in the registry of models (bullet is slow)",
    )
    belief: str = option(
        "", "file of `sain_model identify`, with which each episode begins; empty: none"
    )
    open_loop: tuple[int, ...] = option(
        STEPS,
        "numbers of pushes after which errors of rollouts are taken; none: no rollouts",
    )
    out: Path = option(
        Path("evaluation.json"), "file for the errors; a table and a picture go beside it"
    )
    seed: int = option(0, "seed of the bootstrap", minimum=0)


@dataclass(frozen=True)
class IdentifyOptions(Config):
    """Learn from recordings of one laboratory what a model believes before an episode's first push.

    Bags become data sets by ``ros2 run sain_bags to_dataset`` first. Two recordings that disagree
    about a parameter are an error.
    """

    datasets: Annotated[tuple[Path, ...], tyro.conf.Positional] = required(
        "folders of shards *.npz, each a recording of the laboratory"
    )
    out: Path = option(Path("belief.json"), "file for the belief")
    model: str = option("sain", "model that it is for: sain, or the path of a checkpoint")
    pushes: int = option(0, "largest number of pushes of each recording; 0: all", minimum=0)
    unknown: str = option(
        "",
        "what recordings state as nominal: mass is identified (the same bodies in all episodes)",
    )


@dataclass(frozen=True)
class RealImportOptions(Config):
    """Make a data set of a real robot's pushes: .csv with a header, or .npz and .mat as published.

    docs/guides/real_pushes.md shows the columns. Pushes that nearly repeat each other become one
    episode, so that no split divides them.
    """

    paths: Annotated[tuple[Path, ...], tyro.conf.Positional] = required(
        "files of pushes, or folders of them"
    )
    out: Path = required("new folder for the data set")
    shapes: Path | None = option(
        None,
        "JSON or YAML file of the outlines [m]; by default shapes.json or shapes.yaml beside the"
        " first path",
    )
    tip_radius: float | None = option(
        None, "radius of the tool where rows state none", unit="m", minimum=0.001, maximum=0.05
    )
    mass: float = option(
        MASS_MIDDLE,
        "nominal mass where rows state none: slow pushes do not depend on it",
        unit="kg",
        minimum=0.001,
        maximum=1000.0,
    )
    skip_bad: bool = option(
        True, "leave out pushes whose tool begins inside the body; else they are an error"
    )


@dataclass(frozen=True)
class LearningCurveOptions(Config):
    """Train on more and more transitions, with a prior and without; compare held-out errors.

    The same command continues after a stop.
    """

    dataset: Annotated[Path, tyro.conf.Positional] = required(DATASET)
    out: Path = required("folder for curves.json, curves.md, curves.png and the state")
    sizes: tuple[int, ...] = option(
        (100, 300, 1000, 3000), "numbers of transitions to train on", minimum=1
    )
    steps: int = option(4000, "steps of the optimiser for every network", minimum=1)
    training: TrainingConfig = TrainingConfig()


def train_options(arguments: list[str]) -> type[TrainOptions]:
    """Return the options with the defaults that ``--preset``, ``--output`` and ``--from`` give.

    Raises:
        CheckpointError: the checkpoint of ``--from`` is not sound.
    """
    scout = argparse.ArgumentParser(add_help=False, allow_abbrev=False, exit_on_error=False)
    scout.add_argument("--preset", default=DEFAULT)
    scout.add_argument("--output")
    scout.add_argument("--from", dest="parent")
    try:
        scouted = scout.parse_known_args(arguments)[0]
    except argparse.ArgumentError:
        return TrainOptions  # which reports it
    defaults = PRESETS.get(scouted.preset, TrainingConfig())
    if scouted.output == PARAMETERS:
        defaults = OF_PARAMETERS
    if scouted.parent:
        from sain_model.training.fine_tuning import Parent  # loads PyTorch

        defaults = Parent.load(scouted.parent).settings
    return make_dataclass(
        "TrainOptions",
        [("training", TrainingConfig, field(default=defaults))],
        bases=(TrainOptions,),
        frozen=True,
        namespace={"__doc__": TrainOptions.__doc__},
    )
