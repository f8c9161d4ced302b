"""``ros2 run sain_bringup graph``: the processes of the graph, looked after until Ctrl-C."""

import sys
import tempfile
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Final

from rich.console import Console

from sain_bringup.bench import ROBOT
from sain_bringup.children import ProcessDiedError
from sain_bringup.conditions import show_line
from sain_bringup.graph import (
    LEARNER,
    RECORDER,
    SEEN_BODIES,
    GraphOptions,
    graph_commands,
    restart_command,
    ros_arguments,
)
from sain_bringup.interrupts import Interrupts, Stopped
from sain_bringup.processes import UNHURRIED, Supervisor
from sain_bringup.reach import describe_reach
from sain_core.guarding import lifetime
from sain_core.shapes.body_file import write_tagged_bodies
from sain_model.compute.kernel_store import compile_visibly
from sain_sim.world.engines import DEFAULT_ROBOT
from sain_sim.world.start import draw_episode
from sain_sim.world.truth import TruthConfig

PATIENT: Final = (RECORDER, LEARNER)  # have files to close
UNWATCHED: Final = {lifetime.SOCKET: "", lifetime.TIMEOUT: ""}  # a driver may wait for its arm
POLL: Final = 0.02  # [s] between looks at the processes
STARTED: Final = 15.0  # [s], after which warnings are printed though processes still start


def run(options: GraphOptions, console: Console) -> int:
    """Run a graph until it is interrupted, or a process ends; return that one's exit code.

    Raises:
        BusyError: another graph runs already.
        ConfigError: a body that the robot cannot push, or whose tags its camera cannot read.
        SainError: a package is not installed, or a log cannot be written.
    """

    def tell(text: str) -> None:
        console.print(f"graph: {text}", markup=False, highlight=False, soft_wrap=True)

    interrupts, code = Interrupts(), 0
    if options.bench is not None:
        options.bench.check()
    if options.robot != DEFAULT_ROBOT:
        tell(describe_reach(options.robot))
    try:
        check_free(options)
        compile_visibly(console)
    except Stopped:
        return 0
    with (
        interrupts.deferred(),
        tempfile.TemporaryDirectory(prefix="sain-graph-") as folder,
        Supervisor(Path(folder), UNHURRIED, tell=tell) as supervisor,
    ):
        logs = start(supervisor, options, Path(folder))
        try:
            watch(supervisor, logs, interrupts, console)
        except ProcessDiedError as error:
            logs.show()
            tell(error.reason)
            code = error.exit_code
        with supervisor.signals_noted():
            supervisor.close_files(UNHURRIED.interrupt)
            supervisor.stop()
        logs.show()
    return code


def check_free(options: GraphOptions) -> None:
    """Raise `BusyError` where another simulator has the namespace; a robot locks it itself."""
    if options.is_real:
        return
    from sain_core.guarding.ros.ownership import lock_namespace
    from sain_core.ros.node_main import command_node

    with command_node("graph") as node:
        lock_namespace(node)()  # the simulator to come locks it again


def watch(supervisor: Supervisor, logs: "Logs", interrupts: Interrupts, console: Console) -> None:
    """Look after the processes until a signal comes; print what keeps the graph from working.

    Raises:
        ProcessDiedError: one ended that is not restarted.
    """
    from sain_bringup.ros.listener import listening

    begun, names = time.monotonic(), [child.name for child in supervisor.children]

    def show_what_is_new() -> None:
        supervisor.check()
        logs.show()

    while not interrupts.came and supervisor.starting(names):
        show_what_is_new()
        time.sleep(POLL)
        if time.monotonic() - begun > STARTED:
            break
    with listening("graph", partial(show_line, console)) as listen:
        while not interrupts.came:
            show_what_is_new()
            listen(POLL)


def start(supervisor: Supervisor, options: GraphOptions, folder: Path) -> "Logs":
    """Start the processes of a graph, which keep their states in a folder; return their logs."""
    if options.see and options.bodies_file is None:
        write_seen_bodies(options, folder)
    start_commands(supervisor, graph_commands(options, ros_arguments(sys.argv[1:]), folder))
    return Logs([child.log for child in supervisor.children])


def start_commands(supervisor: Supervisor, commands: Mapping[str, list[str]]) -> None:
    """Start processes of a graph by their names, each as it is looked after and restarted."""
    for name, command in commands.items():
        variables = UNWATCHED if name == ROBOT else {}
        again = restart_command(name, command)
        supervisor.start(name, command, variables, patient=name in PATIENT, again=again)


def write_seen_bodies(options: GraphOptions, folder: Path) -> None:
    """Write the file of the bodies that the simulator begins with."""
    truth = TruthConfig(engine=options.engine, bottom=options.bottom)
    parameters, scene = draw_episode(options.seed, truth, None, (), 0.0)
    folder.mkdir(parents=True, exist_ok=True)
    write_tagged_bodies(folder / SEEN_BODIES, scene, parameters.bodies)


class Logs:
    """What processes say, as they say it."""

    def __init__(self, paths: list[Path]) -> None:
        self._places = dict.fromkeys(paths, 0)

    def show(self) -> None:
        """Write what is new to standard output."""
        for path, place in self._places.items():
            with path.open("rb") as file:
                file.seek(place)
                text = file.read()
            whole = text[: text.rfind(b"\n") + 1]
            self._places[path] = place + len(whole)
            sys.stdout.write(whole.decode("utf-8", errors="replace"))
        sys.stdout.flush()
