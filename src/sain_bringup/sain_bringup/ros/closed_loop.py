"""``ros2 run sain_bringup closed_loop``: the whole graph, from a clean start to a report."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Final

import rclpy
import tyro
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from rich.console import Console

from sain_bringup.display import Display
from sain_bringup.graph import RECORDER, GraphConfig, graph_commands
from sain_bringup.interrupts import Interrupts, Stopped
from sain_bringup.options import (
    ClosedLoopOptions,
    check_options,
    describe,
    episode_plans,
    make_output_folder,
)
from sain_bringup.processes import StopConfig, Supervisor
from sain_bringup.report import EPISODES_KEY
from sain_bringup.results import write_results
from sain_bringup.ros.director import Director
from sain_core.errors import SainError
from sain_core.provenance import provenance
from sain_eval.scenes.scenarios import SCENARIOS

UNHURRIED: Final = StopConfig(interrupt=15.0)  # when all went well and nobody is waiting


def run(options: ClosedLoopOptions, display: Display, interrupts: Interrupts) -> bool:
    """Play the episodes and write the results; return whether all reached the goal.

    Raises:
        SainError: an option that makes no sense, an output that cannot be written, or a graph
            that broke. No process is left behind, and what was recorded is whole.
    """
    check_options(options)
    folder = make_output_folder(options)
    display.headline(describe(episode_plans(options), options), folder)
    with Supervisor(folder / "logs") as supervisor:

        def check() -> None:
            interrupts.check()
            supervisor.check()

        with interrupts.deferred():
            play(options, folder, supervisor, display, check)
        with display.stage("closing the recording", "graph stopped, recording closed"):
            supervisor.close_files(UNHURRIED.interrupt)
            supervisor.stop(UNHURRIED)
    return write_results(folder, options.video, display)


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
        director = Director(check, options.timeout)
        episodes = " ".join(f"{plan.scenario}:{plan.seed}" for plan in plans)
        about = {EPISODES_KEY: episodes, "model": options.model, **provenance("sain_bringup")}
        config = GraphConfig(
            namespace=director.get_namespace(),
            model=options.model,
            seed=options.seed,
            bag=folder / "bag",
            real_time_factor=1.0 if options.gui else 0.0,
            gui=options.gui,
            params_file=options.params_file,
            custom_data=tuple(about.items()),
        )
        for name, command in graph_commands(config).items():
            supervisor.start(name, command, patient=name == RECORDER)
        director.wait_for_graph(
            lambda missing: display.status(f"starting the graph, waiting for {missing}")
        )
    for number, plan in enumerate(plans, start=1):
        case = SCENARIOS[plan.scenario].scene(plan.seed)
        with display.episode(number, len(plans), plan) as view:
            director.play(case, options.tolerance, view)


def guarded(work: Callable[[], bool], console: Console) -> int:
    """Do the work; return the exit code and say in one line what went wrong."""
    try:
        return 0 if work() else 1
    except SainError as error:
        console.print(f"closed_loop: {error}", style="red", markup=False, highlight=False)
        return 1
    except Stopped as stopped:
        console.print("Stopped. No process is left; what was recorded is whole.", style="yellow")
        return 128 + stopped.number


def main() -> None:
    """Run from the command line."""
    arguments = remove_ros_args(sys.argv)[1:]
    options = tyro.cli(ClosedLoopOptions, prog="ros2 run sain_bringup closed_loop", args=arguments)
    display = Display(Console())
    interrupts = Interrupts()
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    try:
        code = guarded(
            lambda: run(options, display, interrupts), Console(stderr=True, soft_wrap=True)
        )
    finally:
        rclpy.try_shutdown()
    sys.exit(code)


if __name__ == "__main__":
    main()
