"""``ros2 run sain_model learning_curve``: how many transitions a network needs."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.console import Console

from sain_core.cli.terminal import make_table, markdown_table
from sain_core.config import Config, option, required
from sain_core.output import OVERWRITE_HELP, claim_folder, write_json, write_whole
from sain_core.provenance import ros2_command
from sain_model.training.settings import TrainingConfig

if TYPE_CHECKING:
    from sain_model.training.learning_curve import Point


@dataclass(frozen=True)
class LearningCurveOptions(Config):
    """Train on more and more transitions, with a prior and without; compare held-out errors.

    The same command continues after a stop.
    """

    dataset: Annotated[Path, tyro.conf.Positional] = required("a shard *.npz, or a folder of them")
    out: Path = required("folder for curves.json, curves.md, curves.png and the state")
    overwrite: bool = option(False, OVERWRITE_HELP)
    sizes: tuple[int, ...] = option(
        (100, 300, 1000, 3000), "numbers of transitions to train on", minimum=1
    )
    steps: int = option(4000, "steps of the optimiser for every network", minimum=1)
    training: TrainingConfig = TrainingConfig()


def run(options: LearningCurveOptions, console: Console) -> None:
    """Train, measure, print the table, write JSON, Markdown and picture.

    Raises:
        DatasetError, CheckpointError, OutputError: see `sain_core.errors`.
    """
    import torch

    from sain_core.view.figures import write_png
    from sain_model.data.dataset import load_dataset, split_by_episode
    from sain_model.training.learning_curve import draw_curves, learning_curve

    torch.set_num_threads(1)
    claim_folder(options.out, ("curves.json", "curves.md", "curves.png"), options.overwrite)
    config = options.training
    data = load_dataset(options.dataset)
    split = split_by_episode(data, config.seed, config.validation, config.test)
    sizes = tuple(sorted(set(options.sizes)))

    def tell(prior: str, size: int) -> None:
        console.print(f"training on {size} transitions, prior {prior}")

    points = learning_curve(split, config, sizes, options.steps, options.out / "state", tell)
    report = {
        "dataset": {"path": str(options.dataset), "sha256": data.sha256},
        "held_out": len(split.test),
        "training": asdict(config),
        "steps": options.steps,
        "command": ros2_command("sain_model", "learning_curve"),
        "points": [asdict(point) for point in points],
    }
    write_json(options.out / "curves.json", report)
    header, *rows = _cells(points, "{mean:.2f} [{low:.2f}, {high:.2f}]")
    write_whole(options.out / "curves.md", markdown_table(header, rows).encode())
    write_png(draw_curves(points), options.out / "curves.png")
    header, *rows = _cells(points, "{mean:.2f}")
    title = f"Target's mean error [mm] on {len(split.test)} held-out pushes"
    console.print(make_table(title, header, rows), soft_wrap=True)
    console.print(f"written to {options.out}")


def _cells(points: "list[Point]", write: str) -> list[list[str]]:
    """Return header and rows: a column for each number of transitions, one for physics alone.

    `write` is how a point is written, as by `str.format`.
    """
    sizes = sorted({point.transitions for point in points})
    known = {(point.name, point.transitions): vars(point) for point in points}
    names = dict.fromkeys(point.name for point in points)
    header = ["predictor", *(f"{size:,}" if size else "none" for size in sizes)]
    cells = {place: write.format(**values) for place, values in known.items()}
    return [header, *([name, *(cells.get((name, size), "") for size in sizes)] for name in names)]
