"""`ros2 run sain_eval evaluate`: controllers on seeded scenes, with the real arm, without ROS."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Final, Self

import tyro
from rich.console import Console

from sain_core.config import MOST_SEED, option
from sain_core.errors import ConfigError
from sain_core.goal import MOST_TOLERANCE, MOST_TURN
from sain_core.output import OVERWRITE_HELP, claim_folder
from sain_core.provenance import ros2_command
from sain_core.workers import WorkerOptions
from sain_core.world import observation_settings
from sain_eval.episode import Tolerance
from sain_eval.loop.closed_loop import agent_maker
from sain_eval.loop.evaluation import EpisodeJob, play, run_jobs
from sain_eval.loop.results import RESULT_FILES, Journal, SceneRecord, summarise, write_results
from sain_eval.loop.tables import FAILURES_FILE, TABLES, show_failures, show_summary, write_tables
from sain_eval.scenes.scenarios import OFFERED, SCENARIOS
from sain_model.compute.kernel_store import compile_visibly
from sain_mppi.agent.agent import AgentConfig
from sain_mppi.agent.uncertainty import EstimatorConfig
from sain_mppi.config import PlannerConfig
from sain_sim.camera.camera import WorldCameraConfig
from sain_sim.world.truth import RANDOMISED_TRUTH, TruthConfig


@dataclass(frozen=True)
class TablePart:
    """Scenarios that are played by the same controllers to the same tolerances."""

    scenarios: tuple[str, ...]  # their names
    controllers: tuple[str, ...]  # their names
    tolerances: tuple[Tolerance, ...]  # the widest first
    most_scenes: int | None = None  # of each scenario; None: as many as are asked for

    def scenes(self, asked: int) -> int:
        """Return how many scenes of each scenario are played where so many are asked for."""
        return asked if self.most_scenes is None else min(asked, self.most_scenes)

    def with_models(self, names: Sequence[str]) -> Self:
        """Return the part with more controllers, unless it is played on few scenes only."""
        if self.most_scenes is not None:
            return self
        return replace(self, controllers=tuple(dict.fromkeys([*self.controllers, *names])))


# The paper gives 5 cm. The tolerances of poses are those of docs/explanation/shapes.md.
PAPER_TOLERANCES: Final = tuple(map(Tolerance, (0.05, 0.02, 0.01, 0.005)))
POSE_TOLERANCES: Final = (Tolerance(0.02, 0.1), Tolerance(0.01, 0.05), Tolerance(0.005, 0.03))
STREAKS: Final = 3  # each takes up to 100 goals

TABLE_PARTS: Final = (
    TablePart(
        ("paper", "paper_shift", "paper_cube"),
        ("null", "straight", "random", "planar", "sain", "oracle"),
        PAPER_TOLERANCES,
    ),
    TablePart(
        ("anywhere", "anywhere_cube"), ("straight", "planar", "sain", "oracle"), PAPER_TOLERANCES
    ),
    TablePart(
        ("box", "push_t", "shapes", "shapes_indirect", "rearrange_2", "rearrange_3", "rearrange_4"),
        ("random", "planar", "sain", "oracle"),
        POSE_TOLERANCES,
    ),
    TablePart(("blocked",), ("straight", "planar", "sain", "oracle"), POSE_TOLERANCES),
    TablePart(("streak",), ("planar",), POSE_TOLERANCES, STREAKS),
)
TABLE_NOTE: Final = (
    "Scenarios of shapes are played without `null` and `straight`: these have no pushes for poses."
    " `straight` pushes a body 0 that is a disk only, as in `blocked`. `streak` takes longest: it"
    f" has at most {STREAKS} scenes, of `planar`."
)


@dataclass(frozen=True)
class EvaluateOptions(WorkerOptions):
    """Run controllers in seeded simulated scenes and report their success rates.

    All controllers get the same scenes. After a stop, the same command continues.
    """

    out: Path = option(
        Path("results/evaluation"),
        "folder for results.json, table.md, episodes.jsonl and pictures; made if need be",
    )
    overwrite: bool = option(False, OVERWRITE_HELP)
    scenario: str = option(
        "anywhere", f"one or more, with commas, of {', '.join(SCENARIOS)}, or of installed packages"
    )
    scenes: int = option(40, "scenes of each scenario", minimum=1)
    seed: int = option(
        0,
        "seed of the first scene; the next scenes have the next seeds",
        minimum=0,
        maximum=MOST_SEED,
    )
    controllers: str = option(
        "null,straight,planar",
        "with commas: null, straight, random, oracle, or a model that MPPI plans with: planar,"
        " planar_axes, identity, sain or the path of a checkpoint",
    )
    tolerances: str = option(
        "0.05,0.02",
        "what counts as success, with commas: METRES or METRES:RADIANS from the goal; without"
        " RADIANS, headings have 5 rad for each metre; an episode ends at the smallest",
    )
    history: bool = option(True, "models infer the friction from earlier pushes of the episode")
    belief: str = option("", "file of `sain_model identify`, for models that take one; empty: none")
    pictures: int = option(0, "episodes of each scenario and controller to draw", minimum=0)
    table: bool = option(
        False,
        "make the whole table: the paper's scenarios with all baselines, and those of shapes and"
        " poses; --scenario, --controllers and --tolerances have no effect",
    )
    models: str = option(
        "", "with --table, models beside its own, with commas: names, or paths of checkpoints"
    )
    truth: Annotated[TruthConfig, tyro.conf.arg(name="")] = RANDOMISED_TRUTH
    camera: Annotated[WorldCameraConfig, tyro.conf.arg(name="")] = WorldCameraConfig()
    planner: Annotated[PlannerConfig, tyro.conf.arg(help="How MPPI plans.")] = field(
        default_factory=PlannerConfig
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.models and not self.table:
            raise ConfigError(
                f"--models is {self.models!r} without --table; give models as --controllers"
            )
        for name in _split(self.scenario, "scenario"):
            OFFERED.check(name)
        for tolerance in self.tolerance_values:
            for value, most, unit in (
                (tolerance.distance, MOST_TOLERANCE, "m"),
                (tolerance.turn, MOST_TURN, "rad"),
            ):
                if not 0.0 < value <= most:
                    raise ConfigError(
                        f"--tolerances has {value} {unit}; allowed: above 0, at most {most} {unit}"
                    )

    @property
    def parts(self) -> tuple[TablePart, ...]:
        """What to play, in order."""
        if self.table:
            return tuple(part.with_models(_words(self.models)) for part in TABLE_PARTS)
        scenarios = _split(self.scenario, "scenario")
        controllers = _split(self.controllers, "controllers")
        return (TablePart(scenarios, controllers, self.tolerance_values),)

    @property
    def tolerance_values(self) -> tuple[Tolerance, ...]:
        """The tolerances without `table`, the widest first."""
        words = _split(self.tolerances, "tolerances")
        try:
            given = {Tolerance.parse(word) for word in words}
        except ValueError as error:
            raise ConfigError(
                f"--tolerances is {self.tolerances!r}; allowed: numbers with commas, or pairs as"
                " 0.02:0.1 in m and rad"
            ) from error
        return tuple(sorted(given, key=lambda one: (one.distance, one.turn), reverse=True))

    @property
    def agent(self) -> AgentConfig:
        """How agents decide: what is not chosen here is as in the planner's node."""
        estimator = EstimatorConfig(**observation_settings(self.camera))
        return AgentConfig(history=self.history, planner=self.planner, estimator=estimator)

    def planned(self) -> dict[tuple[str, int, str], TablePart]:
        """Return the part of each episode to play, by scenario, seed and controller, in order."""
        return {
            (scenario, seed, controller): part
            for part in self.parts
            for scenario in part.scenarios
            for seed in range(self.seed, self.seed + part.scenes(self.scenes))
            for controller in part.controllers
        }

    def settings(self) -> dict[str, object]:
        """Return what a record depends on besides scenario, seed and controller."""
        return {
            "table": self.table,
            "tolerances": [[one.stored() for one in part.tolerances] for part in self.parts],
            "history": self.history,
            "belief": self.belief,
            "truth": dataclasses.asdict(self.truth),
            "camera": dataclasses.asdict(self.camera),
            "planner": dataclasses.asdict(self.planner),
        }


def run(options: EvaluateOptions, console: Console) -> None:
    """Evaluate, and print the summary as a table."""
    progress = Console(stderr=True, soft_wrap=True)
    records = evaluate(options, ros2_command("sain_eval", "evaluate"), progress)
    show_summary(summarise(records), console)
    if options.table:
        console.print(f"\n{TABLE_NOTE}", markup=False, highlight=False, soft_wrap=True)
    show_failures(records, options.out / FAILURES_FILE, console)


def evaluate(options: EvaluateOptions, command: str, console: Console) -> list[SceneRecord]:
    """Run what is left of an evaluation and write its results.

    Raises `OutputError`: the folder cannot be written or holds other results; `CheckpointError`: a
    controller's model cannot be loaded.
    """
    pictures = [one.picture.name for one in jobs_of(options, set()) if one.picture]
    claim_folder(options.out, (*RESULT_FILES, *TABLES, *pictures), options.overwrite)
    journal = Journal(options.out, options.settings(), options.overwrite)
    compile_visibly(console)  # neither the first plan nor each worker
    for name in dict.fromkeys(name for part in options.parts for name in part.controllers):
        agent_maker(name, options.agent, options.belief)  # a bad one should not wait for its scene
    jobs = jobs_of(options, journal.done)
    play(run_jobs(jobs, options), len(jobs), journal, console)
    planned = options.planned()
    kept = sorted(
        (record for record in journal.records if record.episode in planned),
        key=lambda record: (record.place, record.seed, record.controller),  # whoever was first
    )
    config = {**dataclasses.asdict(options), "out": str(options.out)}
    write_results(options.out, kept, config, command)
    write_tables(options.out, kept, TABLE_NOTE if options.table else "")
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


def _split(words: str, name: str) -> tuple[str, ...]:
    parts = tuple(dict.fromkeys(_words(words)))
    if not parts:
        raise ConfigError(f"--{name} is empty; at least one is needed")
    return parts


def _words(text: str) -> list[str]:
    return [word.strip() for word in text.split(",") if word.strip()]
