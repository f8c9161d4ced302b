"""`ros2 run sain_eval evaluate`: controllers on seeded scenes, with the real arm, without ROS."""

import dataclasses
from collections.abc import Generator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Final

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
from sain_eval.cli.options import TABLE_NOTE, EvaluateOptions
from sain_eval.loop.controllers import BASELINES, agent_maker
from sain_eval.loop.evaluation import EpisodeJob, Record, run_jobs
from sain_eval.loop.results import Journal, SceneRecord, summarise, write_results
from sain_eval.loop.tables import (
    HEADER,
    failure_line,
    failures,
    failures_page,
    results_table,
    shape_table,
    table_cells,
)
from sain_model.compute.kernel_store import compile_visibly

TABLE_FILE: Final = "table.md"
SHAPE_TABLE_FILE: Final = "table_per_shape.md"
FAILURES_FILE: Final = "failures.md"
MOST_FAILURES: Final = 40  # that are printed


def run(options: EvaluateOptions, console: Console) -> None:
    """Evaluate, and print the summary as a table."""
    progress = Console(stderr=True, soft_wrap=True)
    records = evaluate(options, ros2_command("sain_eval", "evaluate"), progress)
    show(summarise(records), console)
    if options.table:
        console.print(f"\n{TABLE_NOTE}", markup=False, highlight=False, soft_wrap=True)
    show_failures(records, options.out / FAILURES_FILE, console)


def evaluate(options: EvaluateOptions, command: str, console: Console) -> list[SceneRecord]:
    """Run what is left of an evaluation and write its results.

    Raises:
        OutputError: the folder cannot be written or holds other results.
        CheckpointError: a controller's model cannot be loaded.
    """
    compile_visibly(console)  # neither the first plan nor each worker
    with silent_interrupts():
        for name in dict.fromkeys(name for part in options.parts for name in part.controllers):
            # a bad name should not wait for its first scene
            agent_maker(name, options.agent, options.belief)
    journal = Journal(make_folder(options.out), options.settings(), SceneRecord)
    jobs = jobs_of(options, journal.done)
    play(run_jobs(jobs, options), len(jobs), journal, console)
    planned = options.planned()
    kept = sorted(
        (record for record in journal.records if record.episode in planned),
        key=lambda record: (record.place, record.seed, record.controller),  # whoever was first
    )
    config = {**dataclasses.asdict(options), "out": str(options.out)}
    write_results(options.out, kept, config, command)
    write_whole(options.out / TABLE_FILE, table_page(options, kept).encode())
    if per_shape := shape_table(kept):
        write_whole(options.out / SHAPE_TABLE_FILE, per_shape.encode())
    write_whole(options.out / FAILURES_FILE, failures_page(kept).encode())
    return kept


def jobs_of(options: EvaluateOptions, done: set[tuple[str, int, str]]) -> list[EpisodeJob]:
    """Return the episodes that are still to be run, scene by scene."""
    return [
        EpisodeJob(
            *key,
            part.tolerances,
            options.agent,
            _picture(options, *key),
            options.truth,
            options.belief,
            options.camera,
        )
        for key, part in options.planned().items()
        if key not in done
    ]


def _picture(options: EvaluateOptions, scenario: str, seed: int, controller: str) -> Path | None:
    if seed >= options.seed + options.pictures:
        return None
    return options.out / f"{scenario}_{seed}_{controller.replace('/', '_')}.png"


def play(
    results: Generator[list[Record], None, None],
    count: int,
    journal: Journal[Record],
    console: Console,
) -> None:
    """Keep the records of so many episodes in a journal as they come, under a bar."""
    if done := len(journal.done):
        console.print(f"{done} episodes are done already", highlight=False)
    times = (TimeElapsedColumn(), "left", TimeRemainingColumn())
    columns = ("episodes", BarColumn(), MofNCompleteColumn(), *times)
    with Progress(*columns, console=console) as progress, closing(results):
        task = progress.add_task("episodes", total=count)
        for records in results:
            journal.add(records)
            progress.advance(task)


def table_page(options: EvaluateOptions, records: list[SceneRecord]) -> str:
    """Return the summary as a page: the table, and what belongs to the whole one."""
    table = results_table(summarise(records))
    if not options.table:
        return table
    planned = [one for one in failures(records) if one.controller not in BASELINES]
    lines = "".join(f"* {failure_line(record)}\n" for record in planned)
    return (
        f"{table}\n{TABLE_NOTE}\n\nFailures of controllers that plan; all are in"
        f" [{FAILURES_FILE}]({FAILURES_FILE}), each shape is in"
        f" [{SHAPE_TABLE_FILE}]({SHAPE_TABLE_FILE}):\n\n{lines or 'None.'}"
    )


def show(summary: list[dict[str, Any]], console: Console) -> None:
    """Print the summary as a table."""
    table = FittingTable()
    for name in HEADER:
        table.add_column(name)
    for row in summary:
        table.add_row(*table_cells(row))
    console.print(table, soft_wrap=True)


def show_failures(records: Sequence[SceneRecord], path: Path, console: Console) -> None:
    """Print each failed episode with its reason; where there are many, the first ones."""
    lines = [failure_line(record) for record in failures(records)]
    if lines:
        console.print(f"\nFailures ({len(lines)}):", highlight=False)
    for line in lines[:MOST_FAILURES]:
        console.print(f"  {line}", markup=False, highlight=False, soft_wrap=True)
    if len(lines) > MOST_FAILURES:
        console.print(f"  and {len(lines) - MOST_FAILURES} more in {path}", markup=False)
