"""``ros2 run sain_bringup closed_loop``: the whole graph, from a clean start to a report."""

import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

from rich.console import Console

from sain_bags.bag.metadata import describe_recording
from sain_bringup.display import Display
from sain_bringup.graph import (
    MODEL,
    PLANNER,
    RECORDER,
    SIMULATOR,
    graph_commands,
    restart_command,
    ros_arguments,
)
from sain_bringup.interrupts import Interrupts, Stopped
from sain_bringup.options import (
    EPISODES_KEY,
    NAMESPACE_KEY,
    ClosedLoopOptions,
    describe,
    episode_plans,
    make_output_folder,
)
from sain_bringup.processes import UNHURRIED, Supervisor
from sain_bringup.ros.director import Director
from sain_core.errors import SainError
from sain_core.provenance import provenance
from sain_core.ros.node_main import ros_context
from sain_eval.scenes.scenarios import draw_scene
from sain_model.compute.kernel_store import (
    compile_kernels,
    describe_compilation,
    describe_progress,
    kernels_are_ready,
)

BAG: Final = "bag"  # folder of the recording


def run(options: ClosedLoopOptions, console: Console) -> int:
    """Play the episodes and write the results; return 0 if all reached the goal.

    Raises:
        SainError: an output that cannot be written, or a graph that broke. No process is left
            behind, and what was recorded is whole, or the error says how it becomes so.
    """
    interrupts, display = Interrupts(), Display(console)
    folder = make_output_folder(options)
    try:
        with ros_context():
            return 0 if play_and_report(options, folder, display, interrupts) else 1
    except Stopped as stopped:
        text = f"Stopped. No process is left. {what_is_left(folder, display.begun)}"
        Console(stderr=True, soft_wrap=True).print(text, style="yellow", markup=False)
        return 128 + stopped.number
    except SainError as error:
        raise SainError(f"{error}\n{what_is_left(folder, display.begun)}") from error


def what_is_left(folder: Path, episodes: int) -> str:
    """Return what became of the results of a run that failed; without an episode there are none."""
    if episodes:
        return f"{describe_recording(folder / BAG)} It is in {folder / BAG}/."
    shutil.rmtree(folder, ignore_errors=True)
    return f"No episode was played, so {folder} was removed."


def play_and_report(
    options: ClosedLoopOptions, folder: Path, display: Display, interrupts: Interrupts
) -> bool:
    """Play the episodes and write the results; return whether all reached the goal."""
    display.headline(describe(episode_plans(options), options), folder)
    compile_first(display)
    with Supervisor(folder / "logs", tell=display.note) as supervisor:

        def check() -> None:
            interrupts.check()
            supervisor.check()

        with interrupts.deferred():
            play(options, folder, supervisor, display, check)
        with display.stage("closing the recording", "graph stopped, recording closed"):
            supervisor.close_files(UNHURRIED.interrupt)
            supervisor.stop(UNHURRIED)
    from sain_bringup.results import write_results  # loads what the start need not wait for

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
    plans = episode_plans(options)
    with display.stage("starting the graph", "simulator, model, planner and recorder are up"):
        director = Director(check, options.timeout, supervisor)
        episodes = " ".join(f"{plan.scenario}:{plan.seed}" for plan in plans)
        namespace = director.get_namespace()
        about = {EPISODES_KEY: episodes, NAMESPACE_KEY: namespace, "model": options.model}
        about |= provenance("sain_bringup")
        graph = options.graph(folder / BAG)
        ros = ros_arguments(sys.argv[1:])
        commands = graph_commands(graph, ros, folder / "logs", about, full_motion=True)
        for name, command in commands.items():
            again = restart_command(name, command)
            supervisor.start(name, command, patient=name == RECORDER, again=again)
        director.wait_for_graph(
            lambda: supervisor.starting((SIMULATOR, MODEL, PLANNER, RECORDER)),
            lambda missing: display.status(waiting_for(missing)),
        )
    for number, plan in enumerate(plans, start=1):
        case = draw_scene(plan.scenario, plan.seed)
        with display.episode(number, len(plans), plan) as view:
            director.play(case, options.tolerance, view)


def waiting_for(missing: str) -> str:
    """Return what to show while processes are missing."""
    more = describe_compilation()
    return f"starting the graph, waiting for {missing}{more and f', {more}'}"
