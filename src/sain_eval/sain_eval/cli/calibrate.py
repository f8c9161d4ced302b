"""``ros2 run sain_eval calibrate``: fit the planar prior to Bullet with the arm, and report."""

from dataclasses import asdict
from typing import Final

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

from sain_core.provenance import ros2_command
from sain_core.storage import make_folder, write_json, write_whole
from sain_eval.calibrate import Calibration, calibrate
from sain_eval.cli.options import CalibrateOptions
from sain_model.data.dataset import Dataset, load_dataset
from sain_model.evaluation.tables import markdown_table
from sain_sim.collecting.collect import CollectConfig, collect
from sain_sim.collecting.episode import EpisodeConfig

ERRORS: Final = ("", "pushes", "target mean", "median", "p95", "mid mean", "median", "p95")
PARTS: Final = {"all": "All pushes", "target_moved": "Pushes that moved the target"}


def run(command: CalibrateOptions, console: Console) -> None:
    """Load or collect, fit, judge and write the report.

    Raises:
        DatasetError, OutputError: see `sain_core.errors`.
    """
    out = make_folder(command.out)
    data = _data(command, console)
    with _bar(console) as bar:
        task = bar.add_task("fit", total=command.steps, score=float("nan"))

        def advance(steps: int, score: float) -> None:
            bar.update(task, completed=steps, score=score)

        calibration = calibrate(
            data.alike, command.fit_share, command.steps, command.seed, command.axes, advance
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


def markdown(calibration: Calibration, data: Dataset, command: str) -> str:
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


def _data(command: CalibrateOptions, console: Console) -> Dataset:
    if command.dataset is not None:
        return load_dataset(command.dataset)
    folder = command.out / "data"
    episode = EpisodeConfig(floor_episodes=command.episodes)
    config = CollectConfig(
        folder, command.episodes, command.collection_seed, episode, workers=command.workers
    )
    with _bar(console) as bar:
        task = bar.add_task("collect", total=command.episodes, score=float("nan"))
        collect(config, lambda episodes, transitions: bar.update(task, completed=episodes))
    return load_dataset(folder)


def _bar(console: Console) -> Progress:
    score = "log density {task.fields[score]:.0f}, left"
    columns = (BarColumn(), MofNCompleteColumn(), score, TimeRemainingColumn())
    return Progress("{task.description}", *columns, console=console)
