"""`ros2 run sain_pusht evaluate`: the agent in gym-pusht."""

import dataclasses
from contextlib import closing
from typing import Final

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from sain_core.cli.command_line import silent_interrupts
from sain_core.cli.terminal import FittingTable
from sain_core.provenance import ros2_command
from sain_core.storage import make_folder, write_whole
from sain_model.evaluation.markdown import markdown_table
from sain_pusht.episode import PushtRecord
from sain_pusht.evaluation import (
    PushtJob,
    PushtSummary,
    run_pusht_jobs,
    summarise_pusht,
    write_pusht_results,
)
from sain_pusht.extra import make_env
from sain_pusht.model import load_model
from sain_pusht.options import EvaluateOptions
from sain_pusht.world import MOST_STEPS

TABLE_FILE: Final = "table.md"
FILM_FILE: Final = "episode.gif"
MOST_FAILURES: Final = 20  # that are printed


def run(options: EvaluateOptions, console: Console) -> None:
    """Play, write the results, and print them as a table."""
    with silent_interrupts():  # what is missing should not wait for the first episode
        make_env(MOST_STEPS)
        load_model(options.model)
    folder = make_folder(options.out)
    records = _play(options)
    config = {**dataclasses.asdict(options), "out": str(options.out)}
    write_pusht_results(folder, records, config, ros2_command("sain_pusht", "evaluate"))
    rows = table_rows(options.model, summarise_pusht(records))
    write_whole(folder / TABLE_FILE, markdown_table(("", "gym-pusht"), rows).encode())
    table = FittingTable()
    for name in ("", "gym-pusht"):
        table.add_column(name)
    for row in rows:
        table.add_row(*row)
    console.print(table, soft_wrap=True)
    failed = [record for record in records if not record.success]
    for record in failed[:MOST_FAILURES]:
        console.print(failure_line(record), markup=False, highlight=False, soft_wrap=True)


def _play(options: EvaluateOptions) -> list[PushtRecord]:
    seeds = range(options.seed, options.seed + options.episodes)
    film = options.out / FILM_FILE if options.film else None
    jobs = [
        PushtJob(seed, options.model, options.planner, picture=film if seed == seeds[0] else None)
        for seed in seeds
    ]
    columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    records = []
    with (
        Progress("episodes", *columns, console=Console(stderr=True, soft_wrap=True)) as progress,
        closing(run_pusht_jobs(jobs, options)) as results,
    ):
        task = progress.add_task("episodes", total=len(jobs))
        for record in results:
            records.append(record)
            progress.advance(task)
    return records


def table_rows(model: str, summary: PushtSummary) -> list[tuple[str, str]]:
    """Return names and values of what came of it."""
    rate, steps = summary.success, summary.steps
    error = f"{summary.error_mm:.2f} mm, {summary.error_deg:.2f} deg"
    times = f"{summary.planning_median_s:.2f} / {summary.planning_p95_s:.2f} s"
    return [
        ("model", model),
        ("success, 95 % of the goal covered", f"{summary.successes} of {summary.episodes}"),
        ("  95 % interval", f"{100 * rate.low:.1f} to {100 * rate.high:.1f} %"),
        ("steps, mean", f"{steps.estimate:.1f} ({steps.low:.1f} to {steps.high:.1f})"),
        ("steps, median", f"{summary.steps_median:.0f}"),
        ("steps without contact", f"{100 * summary.free_share:.0f} %"),
        ("strokes, mean", f"{summary.strokes:.1f}"),
        ("largest coverage, mean", f"{summary.best_coverage:.3f}"),
        ("error of a predicted stroke, median", error),
        ("planning a stroke, median / p95", times),
        ("refused strokes", str(summary.refusals)),
    ]


def failure_line(record: PushtRecord) -> str:
    """Return why an episode failed."""
    why = record.failure or "no steps left"
    return (
        f"episode {record.seed} failed after {record.steps} steps and {record.pushes} strokes,"
        f" largest coverage {record.best_coverage:.3f}: {why}"
    )
