"""`ros2 run sain_eval evaluate`: controllers on seeded scenes, with the real arm, without ROS."""

import dataclasses
import shlex
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Final

import tyro
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from sain_core.command_line import describe_options
from sain_core.config import Config, option
from sain_core.errors import ConfigError, SainError
from sain_core.storage import write_whole
from sain_eval.loop.controllers import agent_maker
from sain_eval.loop.evaluation import EpisodeJob, run_jobs
from sain_eval.loop.files import output_folder
from sain_eval.loop.journal import Journal
from sain_eval.loop.report import HEADER, results_table, table_cells
from sain_eval.loop.results import SceneRecord, summarise, write_results
from sain_eval.scenes.scenarios import SCENARIOS
from sain_mppi.loop.settings import AgentConfig
from sain_mppi.search.config import PlannerConfig
from sain_sim.episodes.truth import RANDOMISED_TRUTH, TruthConfig

TABLE_FILE: Final = "table.md"
PAPER_SCENARIOS: Final = "paper,paper_shift,paper_cube"
PAPER_CONTROLLERS: Final = "null,straight,random,planar,sain"
PAPER_TOLERANCES: Final = "0.05,0.02,0.01,0.005"
PAPER_SCENES: Final = 40  # paper Table I
INTERRUPTED: Final = 130  # exit status after Ctrl-C


@dataclass(frozen=True)
class Evaluate(Config):
    """Let controllers solve seeded scenes in the simulated world and report how often they do.

    All controllers get the same scenes. A run that was stopped goes on where it was when the
    same command is given again.
    """

    out: Path
    """Folder for results.json, table.md, episodes.jsonl and pictures; made if need be."""
    scenario: str = "anywhere"
    """One or more, with commas: paper, paper_shift, paper_cube, anywhere, clutter, anywhere_cube,
    anywhere_rubber."""
    scenes: int = option(40, "scenes of each scenario", minimum=1)
    """How many scenes of each scenario."""
    seed: int = option(0, "seed of the first scene; the next have the next", minimum=0)
    """Seed of the first scene; the others have the next ones."""
    controllers: str = "null,straight,planar"
    """With commas: null, straight, random, oracle, or what MPPI plans over: planar, planar_axes,
    identity, sain or the path of a checkpoint."""
    tolerances: str = "0.05,0.02"
    """Distances from the goal that count as success [m], with commas; played to the tightest."""
    history: bool = True
    """Let models learn the friction from the earlier pushes of an episode."""
    workers: int = option(1, "processes", minimum=1, maximum=256)
    """Processes that run episodes side by side; planning times mean little when cores are short."""
    pictures: int = option(0, "pictures of each controller", minimum=0)
    """Draw this many episodes of each scenario and controller."""
    table: bool = False
    """Make the paper's table: its three scenarios, baselines, planar and sain, four tolerances."""
    truth: Annotated[TruthConfig, tyro.conf.arg(name="")] = RANDOMISED_TRUTH
    """The world that is played in: --world randomised or rough, --effects, --lab."""
    planner: Annotated[PlannerConfig, tyro.conf.arg(help="How MPPI plans.")] = field(
        default_factory=PlannerConfig
    )

    def __post_init__(self) -> None:
        """Check the fields, and that every scenario and tolerance is one."""
        super().__post_init__()
        for name in self.scenario_names:
            if name not in SCENARIOS:
                raise ConfigError(f"scenario is {name!r}; allowed: {', '.join(SCENARIOS)}")
        for tolerance in self.tolerance_values:
            if not 0.0 < tolerance <= 1.0:
                raise ConfigError(f"tolerance is {tolerance} m; allowed: above 0, at most 1 m")

    @property
    def scenario_names(self) -> tuple[str, ...]:
        """The scenarios to run."""
        return _split(PAPER_SCENARIOS if self.table else self.scenario, "scenario")

    @property
    def controller_names(self) -> tuple[str, ...]:
        """The controllers to run."""
        return _split(PAPER_CONTROLLERS if self.table else self.controllers, "controllers")

    @property
    def tolerance_values(self) -> tuple[float, ...]:
        """The tolerances [m], the widest first."""
        words = _split(PAPER_TOLERANCES if self.table else self.tolerances, "tolerances")
        try:
            return tuple(sorted({float(word) for word in words}, reverse=True))
        except ValueError as error:
            raise ConfigError(f"tolerances are {self.tolerances!r}; numbers are needed") from error

    @property
    def agent(self) -> AgentConfig:
        """How agents decide: what is not chosen here is as in the planner's node."""
        return AgentConfig(history=self.history, planner=self.planner)

    def settings(self) -> dict[str, object]:
        """Return what a record depends on besides scenario, seed and controller."""
        settings: dict[str, object] = {
            "tolerances": self.tolerance_values,
            "planner": dataclasses.asdict(self.planner),
            "history": self.history,
        }
        if self.truth != RANDOMISED_TRUTH:
            settings["truth"] = dataclasses.asdict(self.truth)
        return settings

    def jobs(self, done: set[tuple[str, int, str]]) -> list[EpisodeJob]:
        """Return the episodes that are still to be run, scene by scene."""
        return [
            EpisodeJob(
                scenario,
                seed,
                controller,
                self.tolerance_values,
                self.agent,
                self._picture(scenario, seed, controller),
                self.truth,
            )
            for scenario in self.scenario_names
            for seed in range(self.seed, self.seed + self.scenes)
            for controller in self.controller_names
            if (scenario, seed, controller) not in done
        ]

    def wants(self, record: SceneRecord) -> bool:
        """Tell whether a record of an earlier run belongs to what was asked for now."""
        return (
            record.scenario in self.scenario_names
            and record.controller in self.controller_names
            and self.seed <= record.seed < self.seed + self.scenes
        )

    def _picture(self, scenario: str, seed: int, controller: str) -> Path | None:
        if seed >= self.seed + self.pictures:
            return None
        return self.out / f"{scenario}_{seed}_{controller.replace('/', '_')}.png"


def evaluate(options: Evaluate, command: str, console: Console) -> list[SceneRecord]:
    """Run what is left of an evaluation and write its results.

    Raises:
        OutputError: the folder cannot be written or holds other results.
        CheckpointError: a controller's model cannot be loaded.
    """
    for name in options.controller_names:
        agent_maker(name, options.agent)  # a bad name should not wait for its first scene
    journal = Journal(output_folder(options.out), options.settings())
    jobs = options.jobs(journal.done)
    if len(jobs) < len(journal.done):
        console.print(f"{len(journal.done)} episodes are done already", highlight=False)
    with _progress(console) as progress:
        task = progress.add_task("episodes", total=len(jobs))
        for records in run_jobs(jobs, options.workers):
            journal.add(records)
            progress.advance(task)
    kept = [record for record in journal.records if options.wants(record)]
    config = {**dataclasses.asdict(options), "out": str(options.out)}
    write_results(options.out, kept, config, command)
    write_whole(options.out / TABLE_FILE, results_table(summarise(kept)).encode())
    return kept


def show(records: list[SceneRecord], console: Console) -> None:
    """Print the summary as a table."""
    table = Table(box=None, pad_edge=False, header_style="dim")
    for name in HEADER:
        table.add_column(name)
    for row in summarise(records):
        table.add_row(*table_cells(row))
    console.print(table)


def _split(words: str, name: str) -> tuple[str, ...]:
    parts = tuple(dict.fromkeys(word.strip() for word in words.split(",") if word.strip()))
    if not parts:
        raise ConfigError(f"{name} is empty; at least one is needed")
    return parts


def _progress(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=console,
    )


def main(arguments: list[str] | None = None) -> None:
    """Run from the command line, or with these arguments."""
    console = Console(stderr=True, soft_wrap=True)
    describe_options(PlannerConfig)
    describe_options(TruthConfig)
    try:
        options = tyro.cli(Evaluate, prog="ros2 run sain_eval evaluate", args=arguments)
        given = sys.argv[1:] if arguments is None else arguments
        command = shlex.join([Path(sys.argv[0]).name, *given])
        records = evaluate(options, command, console)
    except SainError as error:
        console.print(f"evaluate: {error}", style="red", markup=False, highlight=False)
        sys.exit(1)
    except KeyboardInterrupt:
        console.print("evaluate: stopped; the same command goes on from here", highlight=False)
        sys.exit(INTERRUPTED)
    show(records, Console())


if __name__ == "__main__":
    main()
