"""``ros2 run sain_bringup graph``: the whole graph, looked after until Ctrl-C."""

import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Final

from rich.console import Console

from sain_bringup.children import ProcessDiedError
from sain_bringup.graph import RECORDER, ROBOT, graph_commands, restart_command, ros_arguments
from sain_bringup.graph_options import GraphOptions
from sain_bringup.interrupts import Interrupts, Stopped
from sain_bringup.options import RECORDINGS
from sain_bringup.processes import UNHURRIED, Supervisor
from sain_core import notify
from sain_model.compute.kernel_store import compile_visibly

UNWATCHED: Final = {notify.SOCKET: "", notify.TIMEOUT: ""}  # a driver may wait for its arm
POLL: Final = 0.02  # [s] between looks at the processes


def run(options: GraphOptions, console: Console) -> int:
    """Run the graph until it is interrupted, or a process ends; return that one's exit code.

    Raises:
        SainError: a package is not installed, or a log cannot be written.
    """

    def tell(text: str) -> None:
        console.print(f"graph: {text}", markup=False, highlight=False, soft_wrap=True)

    interrupts, code = Interrupts(), 0
    try:
        compile_visibly(console)
    except Stopped:
        return 0
    with (
        suppress(Stopped),  # which `deferred` raises at the end
        interrupts.deferred(),
        tempfile.TemporaryDirectory(prefix="sain-graph-") as folder,
        Supervisor(Path(folder), UNHURRIED, tell=tell) as supervisor,
    ):
        logs = start(supervisor, options, Path(folder))
        try:
            while not interrupts.came:
                supervisor.check()
                logs.show()
                time.sleep(POLL)
        except ProcessDiedError as error:
            logs.show()
            tell(error.reason)
            code = error.exit_code
        with supervisor.signals_noted():
            supervisor.close_files(UNHURRIED.interrupt)
            supervisor.stop()
        logs.show()
    return code


def start(supervisor: Supervisor, options: GraphOptions, folder: Path) -> "Logs":
    """Start the processes of the graph; return their logs."""
    bag = options.bag or RECORDINGS / time.strftime("%Y%m%d-%H%M%S")
    options = replace(options, bag=bag if options.record else None)
    commands = graph_commands(options, ros_arguments(sys.argv[1:]), folder)
    for name, command in commands.items():
        again = restart_command(name, command)
        variables = UNWATCHED if name == ROBOT else {}
        supervisor.start(name, command, variables, patient=name == RECORDER, again=again)
    return Logs([child.log for child in supervisor.children])


class Logs:
    """What processes say, as they say it."""

    def __init__(self, paths: list[Path]) -> None:
        """Begin with these files."""
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
