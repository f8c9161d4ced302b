"""`ros2 run sain_eval evaluate`: controllers on seeded scenes, with the real arm, without ROS."""

import dataclasses
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from sain_core.config import MOST_SEED, option
from sain_core.errors import ConfigError
from sain_core.goal import MOST_TOLERANCE, MOST_TURN
from sain_core.output import OVERWRITE_HELP, claim_folder
from sain_core.policy import POLICY, POLICY_HELP, check_features
from sain_core.provenance import ros2_command
from sain_core.workers import WorkerOptions
from sain_core.world import observation_settings
from sain_eval.episode import Tolerance
from sain_eval.loop.closed_loop import agent_maker, features_of, version_of
from sain_eval.loop.evaluation import EpisodeJob, keep_records, run_jobs
from sain_eval.loop.journal import Journal
from sain_eval.loop.results import RESULT_FILES, SceneRecord, summarise, write_results
from sain_eval.loop.tables import FAILURES_FILE, TABLES, show_failures, show_summary, write_tables
from sain_eval.scenes.anything import is_anything
from sain_eval.scenes.scenarios import MORE, SCENARIOS, check_scenario, draw_scene
from sain_model.compute.kernel_store import compile_visibly
from sain_mppi.agent.agent import AgentConfig
from sain_mppi.agent.uncertainty import EstimatorConfig
from sain_mppi.config import PlannerConfig
from sain_sim.camera.camera import WorldCameraConfig
from sain_sim.world.truth import RANDOMISED_TRUTH, TruthConfig


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
        "anywhere",
        f"one or more, with commas, of {', '.join(SCENARIOS)}, or of installed packages{MORE}",
    )
    outlines: Path | None = option(
        None, "file of outlines with the bodies of `anything`; without it, your own shapes"
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
        " planar_axes, identity, sain or the path of a checkpoint; or, after policy:,"
        f" {POLICY_HELP}",
    )
    tolerances: str = option(
        "0.05,0.02",
        "what counts as success, with commas: METRES or METRES:RADIANS from the goal; without"
        " RADIANS, headings have 5 rad for each metre; an episode ends at the smallest",
    )
    history: bool = option(True, "models infer the friction from earlier pushes of the episode")
    belief: str = option("", "file of `sain_model identify`, for models that take one; empty: none")
    pictures: int = option(0, "episodes of each scenario and controller to draw", minimum=0)
    truth: Annotated[TruthConfig, tyro.conf.arg(name="")] = RANDOMISED_TRUTH
    camera: Annotated[WorldCameraConfig, tyro.conf.arg(name="")] = WorldCameraConfig()
    planner: Annotated[PlannerConfig, tyro.conf.arg(help="How MPPI plans.")] = field(
        default_factory=PlannerConfig
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in _split(self.scenario, "scenario"):
            if not is_anything(name):  # its file is read when the evaluation begins
                check_scenario(name)
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
    def tolerance_values(self) -> tuple[Tolerance, ...]:
        """The tolerances, the widest first."""
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

    @property
    def episodes(self) -> list[tuple[str, int, str]]:
        """The scenario, seed and controller of each episode to play, in order."""
        return [
            (scenario, seed, controller)
            for scenario in _split(self.scenario, "scenario")
            for seed in range(self.seed, self.seed + self.scenes)
            for controller in _split(self.controllers, "controllers")
        ]

    def settings(self) -> dict[str, object]:
        """Return what a record depends on besides scenario, seed and controller."""
        return {
            "tolerances": [one.stored() for one in self.tolerance_values],
            "history": self.history,
            "belief": self.belief,
            "truth": dataclasses.asdict(self.truth),
            "camera": dataclasses.asdict(self.camera),
            "planner": dataclasses.asdict(self.planner),
        } | ({"outlines": str(self.outlines)} if self.outlines else {})


def run(options: EvaluateOptions, console: Console) -> None:
    """Evaluate, and print the summary as a table."""
    progress = Console(stderr=True, soft_wrap=True)
    records = evaluate(options, ros2_command("sain_eval", "evaluate"), progress)
    show_summary(summarise(records), console)
    show_failures(records, options.out / FAILURES_FILE, console)


def evaluate(options: EvaluateOptions, command: str, console: Console) -> list[SceneRecord]:
    """Run what is left of an evaluation and write its results.

    Raises `DatasetError`: the file of outlines cannot be read; `ConfigError`: it has no such body,
    or a policy does not take the bodies of a scene; `OutputError`: the folder cannot be written or
    holds other results; `CheckpointError`: a controller's model cannot be loaded.
    """
    for name in _split(options.scenario, "scenario"):
        check_scenario(name, options.outlines)
    pictures = [one.picture.name for one in jobs_of(options, set()) if one.picture]
    claim_folder(options.out, (*RESULT_FILES, *TABLES, *pictures), options.overwrite)
    names = _split(options.controllers, "controllers")
    versions = {name: version_of(name) for name in names}
    for scenario, seed, name in options.episodes:
        if features := features_of(name):
            case = draw_scene(scenario, seed, options.outlines)
            where = f"{name.removeprefix(POLICY)} in scene {seed} of scenario {scenario}"
            check_features(where, features, len(case.disks))
    journal = Journal(options.out, options.settings(), options.overwrite, versions)
    compile_visibly(console)  # neither the first plan nor each worker
    for name in names:
        agent_maker(name, options.agent, options.belief)  # a bad one should not wait for its scene
    jobs = jobs_of(options, journal.done)
    keep_records(run_jobs(jobs, options), len(jobs), journal, console)
    planned = set(options.episodes)
    kept = sorted(
        (record for record in journal.records if record.episode in planned),
        key=lambda record: (record.place, record.seed, record.controller),  # whoever was first
    )
    config = {**dataclasses.asdict(options), "out": str(options.out)}
    config |= {"outlines": options.outlines and str(options.outlines)}
    write_results(options.out, kept, config, command)
    write_tables(options.out, kept)
    return kept


def jobs_of(options: EvaluateOptions, done: set[tuple[str, int, str]]) -> list[EpisodeJob]:
    """Return the episodes that are still to be run, scene by scene."""
    return [
        EpisodeJob(
            *key,
            options.tolerance_values,
            options.agent,
            _picture(options, *key),
            options.truth,
            options.belief,
            options.camera,
            options.outlines,
        )
        for key in options.episodes
        if key not in done
    ]


def _picture(options: EvaluateOptions, scenario: str, seed: int, controller: str) -> Path | None:
    if seed >= options.seed + options.pictures:
        return None
    return options.out / f"{scenario}_{seed}_{controller.replace('/', '_')}.png"


def _split(words: str, name: str) -> tuple[str, ...]:
    parts = dict.fromkeys(word.strip() for word in words.split(",") if word.strip())
    if not parts:
        raise ConfigError(f"--{name} is empty; at least one is needed")
    return tuple(parts)
