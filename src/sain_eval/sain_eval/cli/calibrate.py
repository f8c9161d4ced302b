"""``ros2 run sain_eval calibrate``: fit the planar prior to Bullet with the arm, and report."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import tyro
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

from sain_core.cli.terminal import markdown_table
from sain_core.config import MOST_SEED, Config, option, required
from sain_core.output import OVERWRITE_HELP, claim_folder, write_json, write_whole
from sain_core.provenance import ros2_command

if TYPE_CHECKING:
    from sain_eval.calibrate import Calibration
    from sain_model.data.dataset import Dataset

ERRORS: Final = ("", "pushes", "target mean", "median", "p95", "mid mean", "median", "p95")
PARTS: Final = {"all": "All pushes", "target_moved": "Pushes that moved the target"}


@dataclass(frozen=True)
class CalibrateOptions(Config):
    """Fit the planar prior's free parameters to pushes made in Bullet with the arm, and report.

    Give a data set that was collected with --floor-episodes, so that the report contains the
    floor, or none to have one collected here.
    """

    out: Path = required("folder for calibration.json and calibration.md; made if need be")
    dataset: Annotated[Path | None, tyro.conf.Positional] = option(
        None, "a shard *.npz or a folder of them; none: collect episodes into OUT/data first"
    )
    episodes: int = option(200, "episodes to collect when no data set is given", minimum=1)
    collection_seed: int = option(1000, "seed of the collection", minimum=0, maximum=MOST_SEED)
    workers: int = option(1, "processes that collect", minimum=1, maximum=4096)
    fit_share: float = option(
        0.25,
        "share of the episodes used for the fit; the others are the test",
        minimum=0.05,
        maximum=0.9,
    )
    steps: int = option(30, "largest number of steps of the fit", minimum=1)
    seed: int = option(0, "seed of the choice of episodes", minimum=0, maximum=MOST_SEED)
    overwrite: bool = option(False, OVERWRITE_HELP)
    axes: bool = option(False, "fit the prior whose friction depends on the world's axes")


def run(options: CalibrateOptions, console: Console) -> None:
    """Load or collect, fit, judge and write the report.

    Raises:
        DatasetError, OutputError: see `sain_core.errors`.
    """
    from sain_eval.calibrate import calibrate

    out = claim_folder(options.out, ("calibration.md", "calibration.json"), options.overwrite)
    data = _data(options, console)
    with _bar(console) as bar:
        task = bar.add_task("fit", total=options.steps, score=float("nan"))

        def advance(steps: int, score: float) -> None:
            bar.update(task, completed=steps, score=score)

        calibration = calibrate(
            data.alike, options.fit_share, options.steps, options.seed, options.axes, advance
        )
    command_text = ros2_command("sain_eval", "calibrate")
    text = markdown(calibration, data, command_text)
    write_whole(out / "calibration.md", text.encode())
    content = {
        "command": command_text,
        "data_sha256": data.sha256,
        **asdict(calibration),
    }
    write_json(out / "calibration.json", content)
    console.print(text, highlight=False, markup=False)


def markdown(calibration: "Calibration", data: "Dataset", command: str) -> str:
    """Return the report as Markdown."""
    lines = [
        "# The planar prior against Bullet with the arm, true parameters in both",
        "",
        f"`{command}`; data {data.sha256[:12]}, {len(data)} pushes, fitted to"
        f" {calibration.fit_pushes} and judged on other episodes. Positions in mm.",
    ]
    for part, rows in calibration.accuracy.items():
        cells = [
            [name, str(row["pushes"]), *(f"{row[column]:.2f}" for column in list(row)[1:])]
            for name, row in rows.items()
        ]
        lines += ["", f"## {PARTS[part]}", "", markdown_table(ERRORS, cells).rstrip("\n")]
    fitted = [[name, f"{value:.4g}"] for name, value in calibration.fitted.items()]
    lines += ["", "## Fitted parameters", "", markdown_table(("parameter", "value"), fitted)]
    return "\n".join(lines)


def _data(options: CalibrateOptions, console: Console) -> "Dataset":
    from sain_model.data.dataset import load_dataset
    from sain_sim.collecting.collect import CollectConfig, collect
    from sain_sim.collecting.episode import EpisodeConfig

    if options.dataset is not None:
        return load_dataset(options.dataset)
    folder = options.out / "data"
    episode = EpisodeConfig(floor_episodes=options.episodes)
    config = CollectConfig(
        folder, options.episodes, options.collection_seed, episode, workers=options.workers
    )
    with _bar(console) as bar:
        task = bar.add_task("collect", total=options.episodes, score=float("nan"))
        collect(config, lambda episodes, transitions: bar.update(task, completed=episodes))
    return load_dataset(folder)


def _bar(console: Console) -> Progress:
    score = "log density {task.fields[score]:.0f}, left"
    columns = (BarColumn(), MofNCompleteColumn(), score, TimeRemainingColumn())
    return Progress("{task.description}", *columns, console=console)
