"""``ros2 run sain_bringup closed_loop``: the whole graph, from a clean start to a report."""

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Final

import tyro
from rich.console import Console

from sain_bags.bag.metadata import describe_recording
from sain_bringup.display import Display
from sain_bringup.graph import (
    EPISODES_KEY,
    NAMESPACE_KEY,
    OUTLINES_HELP,
    RECORDINGS,
    ROBOT_KEY,
    GraphOptions,
    absent,
    stated_bodies,
)
from sain_bringup.interrupts import Interrupts, Stopped
from sain_bringup.processes import UNHURRIED, Supervisor
from sain_bringup.reach import check_reach
from sain_bringup.running import start
from sain_core.config import MOST_SEED, option
from sain_core.errors import OutputError, SainError
from sain_core.guarding.untrusted import PARTIAL
from sain_core.output import MANIFEST, claim_folder, remove, sign
from sain_core.provenance import provenance
from sain_core.shapes.shape import FEET
from sain_core.world import changed_settings
from sain_eval.scenes.scenarios import SCENARIOS, check_in_graph, check_scenario, draw_scene
from sain_model.compute.kernel_store import (
    compile_kernels,
    describe_compilation,
    describe_progress,
    kernels_are_ready,
)
from sain_sim.world.engines import BULLET, DEFAULT_ROBOT

DEMO: Final = (("anywhere", 3), ("paper", 1), ("push_t", 1))
BAG: Final = "bag"  # folder of the recording
LOGS: Final = "logs"
WRITTEN_BY_NODES: Final = (
    *(f"{LOGS}/{name}" for name in ("*.log", "*.json", "*.yaml", f".*{PARTIAL}")),
    *(f"{BAG}/{name}" for name in (f"{BAG}_*.mcap", "metadata.yaml", ".*.part*", ".*.reserve")),
)


@dataclass(frozen=True)
class ClosedLoopOptions(GraphOptions):
    """Run the closed loop on the whole graph: simulator, model, planner and recorder.

    Starts the four as separate processes, plays episodes, and writes a recording, a page, a moving
    picture and a summary. Without options it plays the demo: three `anywhere` episodes, one
    `paper` and one `push_t` episode, each to 2 cm.
    """

    driver: str = absent("")
    faults: str = absent("")
    bodies: Path | None = absent(None)
    pace: float = absent(1.0)
    enable: bool = absent(True)
    record: bool = absent(True)
    bag: Path | None = absent(None)
    episodes: Annotated[int | None, tyro.conf.arg(metavar="N")] = option(
        None, "episodes to play; by default 1 of a chosen scenario", minimum=1
    )
    scenario: str | None = option(
        None,
        f"one of {', '.join(SCENARIOS)}, or of an installed package; by default those of the demo",
    )
    outlines: Path | None = option(None, OUTLINES_HELP)
    seed: int = option(
        0, "seed of the first episode; the next one has the next seed", minimum=0, maximum=MOST_SEED
    )
    tolerance: float = option(
        0.02,
        "largest distance from the goal that counts as reached",
        unit="m",
        minimum=1e-4,
        maximum=0.2,
    )
    out: Path | None = option(
        None, "folder to make for the results; by default bags/closed_loop-<date>-<time>"
    )
    overwrite: bool = option(False, "remove the results of an earlier run there first")
    video: bool = option(True, "render the moving picture at the end")
    timeout: float = option(
        60.0,
        "longest wait for the graph to start, or for an event in an episode",
        unit="s",
        minimum=0.1,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.scenario is not None:
            check_in_graph(self.scenario, self.engine)

    @property
    def plans(self) -> list[tuple[str, int]]:
        """Scenario and seed of each episode to play."""
        if self.scenario is None and self.episodes is None:
            wanted = [name for name, count in DEMO for _ in range(count)]
        else:
            wanted = [self.scenario or DEMO[0][0]] * (self.episodes or 1)
        return [(name, self.seed + number) for number, name in enumerate(wanted)]

    @property
    def folder(self) -> Path:
        """The folder for the results."""
        return self.out or RECORDINGS / time.strftime("closed_loop-%Y%m%d-%H%M%S")

    def recording(self) -> Path:
        """Return the folder of the recording."""
        return self.folder / BAG

    def custom_data(self, namespace: str) -> dict[str, str]:
        """Return what was played and by what."""
        episodes = " ".join(f"{scenario}:{seed}" for scenario, seed in self.plans)
        about = {EPISODES_KEY: episodes, NAMESPACE_KEY: namespace, ROBOT_KEY: self.robot}
        return about | {"model": self.chooses} | provenance()

    def simulator(self) -> dict[str, str]:
        """Have the arm move all the way, for whom watches the recording."""
        return {"cell.full_motion": "true"} | stated_bodies(self.scenario, self.outlines)


def describe(options: ClosedLoopOptions) -> str:
    """Return in a few words what is going to be played."""
    counts = Counter(scenario for scenario, _ in options.plans)
    what = ", ".join(f"{count} × {name}" for name, count in counts.items())
    engine = "" if options.engine == BULLET else f" in {options.engine}"
    engine += "" if options.robot == DEFAULT_ROBOT else f" by {options.robot}"
    engine += "" if options.bottom == FEET else f" on {options.bottom} bottoms"
    by = f", seen by {options.see}" if options.see else ""
    seen = by + "".join(
        f", {name} {value}" for name, value in changed_settings(options.camera).items()
    )
    return f"{what}, to {1e3 * options.tolerance:g} mm, with {options.chooses}{engine}{seen}"


def run(options: ClosedLoopOptions, console: Console) -> int:
    """Play the episodes and write the results; return 0 if all reached the goal.

    Raises:
        ConfigError: the robot does not reach what is to be pushed, or a file has no such body.
        DatasetError: the file of outlines cannot be read.
        SainError: an output that cannot be written, or a graph that broke. No process is left
            behind, and what was recorded is whole, or the error says how it becomes so.
    """
    from sain_core.ros.node_main import ros_context

    interrupts, display = Interrupts(), Display(console)
    for scenario in {scenario for scenario, _ in options.plans}:
        check_scenario(scenario, options.outlines)
    if options.robot != DEFAULT_ROBOT:
        cases = [draw_scene(*plan, options.outlines) for plan in options.plans]
        check_reach(options.robot, cases)
    folder = make_output_folder(options)
    options = replace(options, out=folder)
    try:
        with ros_context():
            return 0 if play_and_report(options, folder, display, interrupts) else 1
    except Stopped as stopped:
        text = f"Stopped. No process is left. {what_is_left(folder, display.begun)}"
        Console(stderr=True, soft_wrap=True).print(text, style="yellow", markup=False)
        return 128 + stopped.number
    except SainError as error:
        raise SainError(f"{error}\n{what_is_left(folder, display.begun)}") from error


def make_output_folder(options: ClosedLoopOptions) -> Path:
    """Make the folder for the results.

    Raises:
        OutputError: it exists and is not empty, or cannot be written.
    """
    folder = options.folder
    if options.overwrite:
        remove(folder)
    claim_folder(folder)
    if others := {path.name for path in folder.glob("*")} - {MANIFEST}:
        raise OutputError(
            f"{folder} has {min(others)}, and a run needs an empty folder: choose another --out, or"
            " --overwrite, which removes the results of an earlier run"
        )
    for pattern in WRITTEN_BY_NODES:
        sign(folder / pattern, grows=True)
    return folder


def what_is_left(folder: Path, episodes: int) -> str:
    """Return what became of the results of a run that failed; without an episode there are none."""
    if episodes:
        return f"{describe_recording(folder / BAG)} It is in {folder / BAG}/."
    try:
        remove(folder)
    except OutputError as error:
        return f"No episode was played. {error}"
    return f"No episode was played, so {folder} was removed."


def play_and_report(
    options: ClosedLoopOptions, folder: Path, display: Display, interrupts: Interrupts
) -> bool:
    """Play the episodes and write the results; return whether all reached the goal."""
    display.headline(describe(options), folder)
    compile_first(display)
    with Supervisor(folder / LOGS, tell=display.note) as supervisor:

        def check() -> None:
            interrupts.check()
            supervisor.check()

        with interrupts.deferred():
            play(options, folder, supervisor, display, check)
        interrupts.check()
        with display.stage("closing the recording", "graph stopped, recording closed"):
            supervisor.close_files(UNHURRIED.interrupt)
            supervisor.stop(UNHURRIED)
    from sain_bringup.report import write_results  # loads what the start need not wait for

    return write_results(folder, options.video, display)


def compile_first(display: Display) -> None:
    """Compile the kernels where that is not done, before any process waits for them."""
    if kernels_are_ready():
        return
    with display.stage("compiling kernels", "kernels compiled"):
        compile_kernels(lambda *progress: display.status(describe_progress(*progress)))


def play(
    options: ClosedLoopOptions,
    folder: Path,
    supervisor: Supervisor,
    display: Display,
    check: Callable[[], None],
) -> None:
    """Start the graph and play all episodes on it, checking again and again."""
    from sain_bringup.ros.director import Director
    from sain_bringup.ros.progress import Progress

    with display.stage("starting the graph", "simulator, model, planner and recorder are up"):
        sight = (folder / LOGS, options.see, options.outlines) if options.see else None
        director = Director(check, options.timeout, supervisor, sight, display.note)
        start(supervisor, options, folder / LOGS)
        names = [child.name for child in supervisor.children]
        director.wait_for_graph(
            lambda: supervisor.starting(names), lambda missing: display.status(waiting_for(missing))
        )
    for number, (scenario, seed) in enumerate(options.plans, start=1):
        with display.episode():
            progress = Progress(display, f"{number}/{len(options.plans)}  {scenario} {seed}")
            case = draw_scene(scenario, seed, options.outlines)
            director.play(case, options.tolerance, progress)
        progress.end()


def waiting_for(missing: str) -> str:
    """Return what to show while processes are missing."""
    more = describe_compilation()
    return f"starting the graph, waiting for {missing}{more and f', {more}'}"
